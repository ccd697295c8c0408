// The walk of live_walk.ts for WebGL 2: a box is drawn around the volume, and each of its pixels has a ray.
import { asGlsl, sceneFields, walk } from './live_walk';

// Puts a part of a smaller picture over the whole canvas.
export const enlargingVertexShader = `
in vec3 position;
uniform vec2 part;
out vec2 from;

void main() {
  from = part * (0.5 * position.xy + 0.5);
  gl_Position = vec4(position.xy, 0.0, 1.0);
}
`;

export const enlargingFragmentShader = `
precision highp float;
uniform sampler2D picture;
uniform vec2 last;
in vec2 from;
out vec4 pixel;

void main() {
  // Beyond the part stands what was drawn before.
  pixel = texture(picture, min(from, last));
}
`;

export const vertexShader = `
in vec3 position;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 dims;
out vec3 place;

void main() {
  place = position * (dims - 1.0);
  gl_Position = projectionMatrix * modelViewMatrix * vec4(place, 1.0);
}
`;

export const fragmentShader = `
precision highp float;
precision highp sampler3D;

uniform sampler3D samples;
uniform sampler3D blocks;
uniform sampler2D look;
uniform sampler2D sums;
${sceneFields.map(([name, type]) => `uniform ${asGlsl(type)} ${name};`).join('\n')}
in vec3 place;
out vec4 pixel;

vec3 select(vec3 otherwise, vec3 chosen, bool isChosen) { return isChosen ? chosen : otherwise; }
vec4 select(vec4 otherwise, vec4 chosen, bool isChosen) { return isChosen ? chosen : otherwise; }

float valueAt(vec3 p) { return texture(samples, (p + 0.5) / dims).r; }
float sampleAt(ivec3 at) { return texelFetch(samples, at, 0).r; }
vec2 rangeAt(ivec3 block) { return texelFetch(blocks, block, 0).rg; }
vec4 tableAt(int value) { return texelFetch(look, ivec2(value, 0), 0); }
vec4 tableBetween(float value) { return texture(look, vec2((255.0 * value + 0.5) / 256.0, 0.5)); }
float sumAt(int value) { return texelFetch(sums, ivec2(value, 0), 0).r; }
${asGlsl(walk)}
void main() {
  pixel = seenAlong(place - eye, gl_FragCoord.xy);
  if (pixel.a <= 0.0) discard;
}
`;
