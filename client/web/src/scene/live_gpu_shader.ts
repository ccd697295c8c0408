// The walk of live_walk.ts as a compute shader, for WebGPU: a pixel each, into a picture that is put over the canvas. The ray is found
// from the pixel, because no box is drawn.
import { sceneFields, walk } from './live_walk';

const scene = `
struct Scene {
${sceneFields.map(([name, type]) => `  ${name}: ${type},`).join('\n')}
  crossOpacity: f32,
  crossColour: vec4f,
  fromScreen: mat4x4f,
  toScreen: mat4x4f,
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

fn valueAt(p: vec3f) -> f32 { return textureSampleLevel(samples, smooth_, (p + 0.5) / scene.dims, 0.0).r; }
fn sampleAt(at: vec3i) -> f32 { return textureLoad(samples, at, 0).r; }
fn rangeAt(block: vec3i) -> vec2f { return textureLoad(blocks, block, 0).rg; }
fn tableAt(value: i32) -> vec4f { return textureLoad(look, vec2i(value, 0), 0); }
fn tableBetween(value: f32) -> vec4f { return textureSampleLevel(look, smooth_, vec2f((255.0 * value + 0.5) / 256.0, 0.5), 0.0); }
fn sumAt(value: i32) -> f32 { return textureLoad(sums, vec2i(value, 0), 0).r; }
${walk}
@compute @workgroup_size(${workgroup}, ${workgroup})
fn walk(@builtin(global_invocation_id) id: vec3u) {
  let pixel = vec2f(id.xy) + vec2f(0.5, 0.5 + scene.rows.x);
  if (pixel.x > scene.size.x || pixel.y > min(scene.size.y, scene.rows.y)) { return; }
  let place = vec2f(2.0, -2.0) * pixel / scene.size + vec2f(-1.0, 1.0);
  let far = scene.fromScreen * vec4f(place, 1.0, 1.0);
  textureStore(picture, vec2i(pixel), seenAlong(far.xyz / far.w - scene.eye, pixel));
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
