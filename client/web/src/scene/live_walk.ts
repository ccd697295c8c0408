// The iso-surface of a volume, or a look through it, by ray-casting: each pixel's ray goes through the samples until they cross the
// iso-value; there the gradient tells how the surface is turned. Blocks that the surface does not meet are passed
// over at once. All places are in samples: sample (0,0,0) is at the origin.
//
// The walk is written once, in WGSL with the type of each variable, and `asGlsl` writes it for WebGL 2. Around it either shader has
// what reads its textures: valueAt (between samples), sampleAt, rangeAt (the least and greatest value of a block), tableAt
// (colour and opacity of a value), tableBetween and sumAt (of the opacities of all values below).

// Values of a scene, in the order in which a uniform buffer has them: a number fits behind each vec3f.
export const sceneFields = [
  ['toNormal', 'mat4x4f'],
  ['eye', 'vec3f'],
  ['iso', 'f32'],
  ['towardsLight', 'vec3f'],
  // In samples; a longer one may pass over what is thinner.
  ['reach', 'f32'],
  ['towardsEye', 'vec3f'],
  // How much only borders between values are seen.
  ['edges', 'f32'],
  ['colour', 'vec3f'],
  // A number of `kinds`.
  ['kind', 'f32'],
  ['cropLow', 'vec3f'],
  ['isCropped', 'f32'],
  ['cropHigh', 'vec3f'],
  ['blockSize', 'f32'],
  ['dims', 'vec3f'],
] as const;

export type SceneField = (typeof sceneFields)[number][0];

export const kinds = { surface: 0, through: 1, labels: 2 } as const;

export const walk = `
const mostSteps: i32 = 2048;
const halvings: i32 = 5;
const nothing: vec4f = vec4f(0.0);

fn slopeAt(p: vec3f) -> vec3f {
  return vec3f(
    valueAt(p + vec3f(1.0, 0.0, 0.0)) - valueAt(p - vec3f(1.0, 0.0, 0.0)),
    valueAt(p + vec3f(0.0, 1.0, 0.0)) - valueAt(p - vec3f(0.0, 1.0, 0.0)),
    valueAt(p + vec3f(0.0, 0.0, 1.0)) - valueAt(p - vec3f(0.0, 0.0, 1.0)));
}

// Either side is seen.
fn seenNormal(slope: vec3f) -> vec3f {
  let normal: vec3f = (scene.toNormal * vec4f(slope, 0.0)).xyz;
  let size: f32 = length(normal);
  let unit: vec3f = select(scene.towardsEye, normal / max(size, 1e-30), size > 0.0);
  return select(unit, -unit, dot(unit, scene.towardsEye) < 0.0);
}

fn shineOf(normal: vec3f) -> f32 {
  return pow(max(0.0, dot(normal, normalize(scene.towardsLight + scene.towardsEye))), 24.0);
}

fn shaded(p: vec3f) -> vec4f {
  let normal: vec3f = seenNormal(slopeAt(p));
  let diffuse: f32 = 0.28 + 0.78 * max(0.0, dot(normal, scene.towardsLight));
  return vec4f(scene.colour * diffuse + 0.10 * shineOf(normal), 1.0);
}

// The place at which the ray leaves its block, and the values in that block.
fn blockAt(direction: vec3f, t: f32, stride: f32) -> vec3f {
  let p: vec3f = clamp(scene.eye + (t + 0.001 * stride) * direction, vec3f(0.0), scene.dims - 1.001);
  let block: vec3i = vec3i(p / scene.blockSize);
  let low: vec3f = vec3f(block) * scene.blockSize;
  let exits: vec3f = (low + step(vec3f(0.0), direction) * scene.blockSize - scene.eye) / direction;
  return vec3f(min(min(exits.x, exits.y), exits.z), rangeAt(block));
}

// True if anything is seen of these values.
fn hasAny(range: vec2f) -> bool {
  let ends: vec2i = vec2i(round(255.0 * range));
  return sumAt(ends.y + 1) > sumAt(ends.x);
}

// One sample's light: its colour times its opacity, and the opacity.
fn seenAt(p: vec3f, stride: f32) -> vec4f {
  let here: vec4f = tableBetween(valueAt(p));
  if (here.a <= 0.0) { return nothing; }
  let slope: vec3f = 0.5 * slopeAt(p);
  let normal: vec3f = seenNormal(slope);
  let light: f32 = 0.35 + 0.7 * max(0.0, dot(normal, scene.towardsLight));
  // Values that hardly change have no border to be lit.
  let isBorder: f32 = clamp(length(slope) * 24.0, 0.0, 1.0);
  let all: f32 = here.a * mix(1.0, isBorder, scene.edges);
  let opacity: f32 = 1.0 - pow(1.0 - min(all, 0.999), stride);
  return vec4f((here.rgb * mix(0.75, light, isBorder) + 0.12 * shineOf(normal) * isBorder) * opacity, opacity);
}

fn lookedThrough(direction: vec3f, begin: f32, end: f32, stride: f32, pixel: vec2f) -> vec4f {
  var seen: vec4f = nothing;
  var blockEnd: f32 = -1.0;
  // Each ray begins at another place, or steps would be seen as rings.
  var t: f32 = begin + stride * fract(52.9829189 * fract(dot(pixel, vec2f(0.06711056, 0.00583715))));
  for (var i: i32 = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      let block: vec3f = blockAt(direction, t, stride);
      blockEnd = block.x;
      if (!hasAny(block.yz)) {
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
  return tableAt(i32(round(255.0 * sampleAt(vec3i(clamp(floor(p + 0.5), vec3f(0.0), scene.dims - 1.0))))));
}

// Turned to where nothing is seen around it.
fn openAround(p: vec3f) -> vec3f {
  var open: vec3f = vec3f(0.0);
  for (var i: i32 = 0; i < 27; i++) {
    let offset: vec3f = vec3f(vec3i(i % 3, (i / 3) % 3, i / 9)) - 1.0;
    if (labelAt(p + 1.5 * offset).a <= 0.0) { open += offset / max(1.0, length(offset)); }
  }
  return open;
}

// The first label that is met.
fn labelled(direction: vec3f, begin: f32, end: f32, stride: f32) -> vec4f {
  var t: f32 = begin;
  var blockEnd: f32 = -1.0;
  for (var i: i32 = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      let block: vec3f = blockAt(direction, t, stride);
      blockEnd = block.x;
      if (!hasAny(block.yz)) {
        t = max(blockEnd, t + 0.01 * stride);
        continue;
      }
    }
    let p: vec3f = scene.eye + t * direction;
    let here: vec4f = labelAt(p);
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
  var t: f32 = begin;
  var isInside: bool = isInsideAt(direction, t);
  var blockEnd: f32 = -1.0;
  // A crop closes the surface where it is cut.
  if (scene.isCropped > 0.0 && isInside) { return vec4f(0.62 * scene.colour, 1.0); }
  for (var i: i32 = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      let block: vec3f = blockAt(direction, t, stride);
      blockEnd = block.x;
      if (scene.iso <= block.y || scene.iso > block.z) {
        isInside = scene.iso <= block.y;
        t = max(blockEnd, t + 0.01 * stride);
        continue;
      }
    }
    var next: f32 = min(t + stride, end);
    if (isInsideAt(direction, next) == isInside) {
      t = next;
      continue;
    }
    for (var n: i32 = 0; n < halvings; n++) {
      let middle: f32 = 0.5 * (t + next);
      if (isInsideAt(direction, middle) == isInside) { t = middle; } else { next = middle; }
    }
    return shaded(scene.eye + next * direction);
  }
  return nothing;
}

// The light along a ray from the eye; the pixel's place tells it from its neighbours.
fn seenAlong(direction: vec3f, pixel: vec2f) -> vec4f {
  let first: vec3f = (scene.cropLow - scene.eye) / direction;
  let second: vec3f = (scene.cropHigh - scene.eye) / direction;
  let enter: vec3f = min(first, second);
  let leave: vec3f = max(first, second);
  let begin: f32 = max(max(enter.x, enter.y), max(enter.z, 0.0));
  let end: f32 = min(min(leave.x, leave.y), leave.z);
  if (!(begin < end)) { return nothing; }
  let stride: f32 = scene.reach / max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
  if (scene.kind == ${kinds.surface}.0) { return surface(direction, begin, end, stride); }
  if (scene.kind == ${kinds.through}.0) { return lookedThrough(direction, begin, end, stride, pixel); }
  return labelled(direction, begin, end, stride);
}
`;

const types: Record<string, string> = {
  f32: 'float',
  i32: 'int',
  vec2f: 'vec2',
  vec3f: 'vec3',
  vec4f: 'vec4',
  vec2i: 'ivec2',
  vec3i: 'ivec3',
  mat4x4f: 'mat4',
};

// Writes the part of WGSL that the walk is written in. Its uniforms have no structure around them.
export function asGlsl(wgsl: string): string {
  const parameters = (text: string): string => text.replaceAll(/(\w+): (\w+)/g, '$2 $1');
  return wgsl
    .replaceAll(/fn (\w+)\(([^)]*)\) -> (\w+)/g, (_, name: string, given: string, type: string) => `${type} ${name}(${parameters(given)})`)
    .replaceAll(/(?:let|var) (\w+): (\w+)/g, '$2 $1')
    .replaceAll(/const (\w+): (\w+)/g, 'const $2 $1')
    .replaceAll('scene.', '')
    .replaceAll(/\b\w+\b/g, (word) => types[word] ?? word);
}
