// The walk of live_shader.ts as a compute shader, for WebGPU: a pixel each, into a picture that is put over the canvas. What differs:
// the ray is found from the pixel, because no box is drawn.

const scene = `
struct Scene {
  fromScreen: mat4x4f,
  toScreen: mat4x4f,
  toNormal: mat4x4f,
  eye: vec3f,
  iso: f32,
  towardsLight: vec3f,
  reach: f32,
  towardsEye: vec3f,
  edges: f32,
  colour: vec3f,
  kind: f32,
  cropLow: vec3f,
  isCropped: f32,
  cropHigh: vec3f,
  blockSize: f32,
  dims: vec3f,
  crossOpacity: f32,
  crossColour: vec4f,
  // Of the picture, and which of its rows are painted.
  size: vec2f,
  rows: vec2f,
}
@group(0) @binding(0) var<uniform> scene: Scene;
`;

export const workgroup = 8;

export const walkShader = `
${scene}
@group(0) @binding(1) var smooth_: sampler;
@group(0) @binding(2) var samples: texture_3d<f32>;
@group(0) @binding(3) var blocks: texture_3d<f32>;
@group(0) @binding(4) var look: texture_2d<f32>;
@group(0) @binding(5) var sums: texture_2d<f32>;
@group(0) @binding(6) var picture: texture_storage_2d<rgba8unorm, write>;

const mostSteps = 2048;
const halvings = 5;
const nothing = vec4f(0.0);

fn valueAt(p: vec3f) -> f32 {
  return textureSampleLevel(samples, smooth_, (p + 0.5) / scene.dims, 0.0).r;
}

fn slopeAt(p: vec3f) -> vec3f {
  return vec3f(
    valueAt(p + vec3f(1, 0, 0)) - valueAt(p - vec3f(1, 0, 0)),
    valueAt(p + vec3f(0, 1, 0)) - valueAt(p - vec3f(0, 1, 0)),
    valueAt(p + vec3f(0, 0, 1)) - valueAt(p - vec3f(0, 0, 1)));
}

// Either side is seen.
fn seenNormal(slope: vec3f) -> vec3f {
  let normal = (scene.toNormal * vec4f(slope, 0.0)).xyz;
  let size = length(normal);
  let unit = select(scene.towardsEye, normal / max(size, 1e-30), size > 0.0);
  return select(unit, -unit, dot(unit, scene.towardsEye) < 0.0);
}

fn shineOf(normal: vec3f) -> f32 {
  return pow(max(0.0, dot(normal, normalize(scene.towardsLight + scene.towardsEye))), 24.0);
}

fn shaded(p: vec3f) -> vec4f {
  let normal = seenNormal(slopeAt(p));
  let diffuse = 0.28 + 0.78 * max(0.0, dot(normal, scene.towardsLight));
  return vec4f(scene.colour * diffuse + 0.10 * shineOf(normal), 1.0);
}

struct Block {
  end: f32,
  range: vec2f,
}

fn blockAt(direction: vec3f, t: f32, stride: f32) -> Block {
  let p = clamp(scene.eye + (t + 0.001 * stride) * direction, vec3f(0.0), scene.dims - 1.001);
  let block = vec3i(p / scene.blockSize);
  let low = vec3f(block) * scene.blockSize;
  let exits = (low + step(vec3f(0.0), direction) * scene.blockSize - scene.eye) / direction;
  return Block(min(min(exits.x, exits.y), exits.z), textureLoad(blocks, block, 0).rg);
}

fn hasAny(range: vec2f) -> bool {
  let ends = vec2i(round(255.0 * range));
  return textureLoad(sums, vec2i(ends.y + 1, 0), 0).r > textureLoad(sums, vec2i(ends.x, 0), 0).r;
}

// One sample's light: its colour times its opacity, and the opacity.
fn seenAt(p: vec3f, stride: f32) -> vec4f {
  let here = textureSampleLevel(look, smooth_, vec2f((255.0 * valueAt(p) + 0.5) / 256.0, 0.5), 0.0);
  if (here.a <= 0.0) { return nothing; }
  let slope = 0.5 * slopeAt(p);
  let normal = seenNormal(slope);
  let light = 0.35 + 0.7 * max(0.0, dot(normal, scene.towardsLight));
  // What hardly changes has no border to be lit.
  let isBorder = clamp(length(slope) * 24.0, 0.0, 1.0);
  let all = here.a * mix(1.0, isBorder, scene.edges);
  let opacity = 1.0 - pow(1.0 - min(all, 0.999), stride);
  return vec4f((here.rgb * mix(0.75, light, isBorder) + 0.12 * shineOf(normal) * isBorder) * opacity, opacity);
}

fn lookedThrough(direction: vec3f, begin: f32, end: f32, stride: f32, pixel: vec2f) -> vec4f {
  var seen = nothing;
  var blockEnd = -1.0;
  // Each ray begins at another place, or steps would be seen as rings.
  var t = begin + stride * fract(52.9829189 * fract(dot(pixel, vec2f(0.06711056, 0.00583715))));
  for (var i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      let block = blockAt(direction, t, stride);
      blockEnd = block.end;
      if (!hasAny(block.range)) {
        t += max(1.0, ceil((blockEnd - t) / stride)) * stride;
        continue;
      }
    }
    seen += (1.0 - seen.a) * seenAt(scene.eye + t * direction, scene.reach);
    if (seen.a > 0.985) { break; }
    t += stride;
  }
  return select(seen, nothing, seen.a < 0.004);
}

fn labelAt(p: vec3f) -> vec4f {
  let nearest = vec3i(clamp(floor(p + 0.5), vec3f(0.0), scene.dims - 1.0));
  return textureLoad(look, vec2i(i32(round(255.0 * textureLoad(samples, nearest, 0).r)), 0), 0);
}

// Turned to where nothing is seen around it.
fn openAround(p: vec3f) -> vec3f {
  var open = vec3f(0.0);
  for (var i = 0; i < 27; i++) {
    let offset = vec3f(vec3i(i % 3, (i / 3) % 3, i / 9)) - 1.0;
    if (labelAt(p + 1.5 * offset).a <= 0.0) { open += offset / max(1.0, length(offset)); }
  }
  return open;
}

// The first label that is met.
fn labelled(direction: vec3f, begin: f32, end: f32, stride: f32) -> vec4f {
  var t = begin;
  var blockEnd = -1.0;
  for (var i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      let block = blockAt(direction, t, stride);
      blockEnd = block.end;
      if (!hasAny(block.range)) {
        t = max(blockEnd, t + 0.01 * stride);
        continue;
      }
    }
    let p = scene.eye + t * direction;
    let here = labelAt(p);
    if (here.a > 0.0) {
      return vec4f(here.rgb * (0.32 + 0.74 * max(0.0, dot(seenNormal(openAround(p)), scene.towardsLight))), 1.0);
    }
    t += stride;
  }
  return nothing;
}

fn isInsideAt(direction: vec3f, t: f32) -> bool {
  return valueAt(scene.eye + t * direction) >= scene.iso;
}

fn surface(direction: vec3f, begin: f32, end: f32, stride: f32) -> vec4f {
  var t = begin;
  var isInside = isInsideAt(direction, t);
  var blockEnd = -1.0;
  // A crop closes the surface where it is cut.
  if (scene.isCropped > 0.0 && isInside) { return vec4f(0.62 * scene.colour, 1.0); }
  for (var i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      let block = blockAt(direction, t, stride);
      blockEnd = block.end;
      if (scene.iso <= block.range.x || scene.iso > block.range.y) {
        isInside = scene.iso <= block.range.x;
        t = max(blockEnd, t + 0.01 * stride);
        continue;
      }
    }
    var next = min(t + stride, end);
    if (isInsideAt(direction, next) == isInside) {
      t = next;
      continue;
    }
    for (var n = 0; n < halvings; n++) {
      let middle = 0.5 * (t + next);
      if (isInsideAt(direction, middle) == isInside) { t = middle; } else { next = middle; }
    }
    return shaded(scene.eye + next * direction);
  }
  return nothing;
}

@compute @workgroup_size(${workgroup}, ${workgroup})
fn walk(@builtin(global_invocation_id) id: vec3u) {
  let pixel = vec2f(id.xy) + vec2f(0.5, 0.5 + scene.rows.x);
  if (pixel.x > scene.size.x || pixel.y > min(scene.size.y, scene.rows.y)) { return; }
  let place = vec2f(2.0, -2.0) * pixel / scene.size + vec2f(-1.0, 1.0);
  let far = scene.fromScreen * vec4f(place, 1.0, 1.0);
  let direction = far.xyz / far.w - scene.eye;
  let first = (scene.cropLow - scene.eye) / direction;
  let second = (scene.cropHigh - scene.eye) / direction;
  let enter = min(first, second);
  let leave = max(first, second);
  let begin = max(max(enter.x, enter.y), max(enter.z, 0.0));
  let end = min(min(leave.x, leave.y), leave.z);
  var seen = nothing;
  if (begin < end) {
    let stride = scene.reach / max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
    if (scene.kind == 0.0) { seen = surface(direction, begin, end, stride); }
    else if (scene.kind == 1.0) { seen = lookedThrough(direction, begin, end, stride, pixel); }
    else { seen = labelled(direction, begin, end, stride); }
  }
  textureStore(picture, vec2i(pixel), seen);
}
`;

export const overShader = `
${scene}
@group(0) @binding(1) var smooth_: sampler;
@group(0) @binding(2) var picture: texture_2d<f32>;

struct Corner {
  @builtin(position) position: vec4f,
  @location(0) part: vec2f,
}

// Puts the part of the picture that was painted over the whole canvas.
@vertex fn corner(@builtin(vertex_index) index: u32) -> Corner {
  let place = vec2f(f32(index & 1u), f32(index >> 1u));
  return Corner(vec4f(4.0 * place.x - 1.0, 1.0 - 4.0 * place.y, 0.0, 1.0), 2.0 * place);
}

@fragment fn enlarged(at: Corner) -> @location(0) vec4f {
  let whole = vec2f(textureDimensions(picture));
  return textureSample(picture, smooth_, min(at.part * scene.size, scene.size - 0.5) / whole);
}

// The lines through the cursor.
@vertex fn end(@location(0) place: vec3f) -> @builtin(position) vec4f {
  let seen = scene.toScreen * vec4f(place, 1.0);
  return vec4f(seen.xy, 0.5 * seen.w, seen.w);
}

@fragment fn line() -> @location(0) vec4f {
  return vec4f(scene.crossColour.rgb * scene.crossOpacity, scene.crossOpacity);
}
`;
