// The iso-surface of a volume by ray-casting: each pixel's ray goes through the samples until they cross the
// iso-value; there the gradient tells how the surface is turned. Blocks that the surface does not meet are passed
// over at once. All places are in samples: sample (0,0,0) is at the origin.

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
uniform float blockSize;
uniform vec3 dims;
uniform vec3 eye;
uniform mat3 toNormal;
uniform vec3 towardsLight;
uniform vec3 towardsEye;
uniform vec3 colour;
uniform float iso;
// In samples; a longer one may pass over what is thinner.
uniform float reach;
in vec3 place;
out vec4 pixel;

const int mostSteps = 2048;
const int halvings = 5;

float valueAt(vec3 p) {
  return texture(samples, (p + 0.5) / dims).r;
}

vec3 normalAt(vec3 p) {
  vec3 slope = vec3(
    valueAt(p + vec3(1, 0, 0)) - valueAt(p - vec3(1, 0, 0)),
    valueAt(p + vec3(0, 1, 0)) - valueAt(p - vec3(0, 1, 0)),
    valueAt(p + vec3(0, 0, 1)) - valueAt(p - vec3(0, 0, 1)));
  vec3 normal = toNormal * slope;
  float size = length(normal);
  return size > 0.0 ? normal / size : towardsEye;
}

vec4 shaded(vec3 p) {
  vec3 normal = normalAt(p);
  // Either side is seen.
  if (dot(normal, towardsEye) < 0.0) normal = -normal;
  float diffuse = 0.28 + 0.78 * max(0.0, dot(normal, towardsLight));
  float shine = 0.10 * pow(max(0.0, dot(normal, normalize(towardsLight + towardsEye))), 24.0);
  return vec4(colour * diffuse + shine, 1.0);
}

void main() {
  vec3 direction = place - eye;
  vec3 first = -eye / direction;
  vec3 second = (dims - 1.0 - eye) / direction;
  vec3 enter = min(first, second);
  vec3 leave = max(first, second);
  float t = max(max(enter.x, enter.y), max(enter.z, 0.0));
  float end = min(min(leave.x, leave.y), leave.z);
  if (!(t < end)) discard;

  float stride = reach / max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
  bool isInside = valueAt(eye + t * direction) >= iso;
  float blockEnd = -1.0;
  for (int i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      vec3 p = clamp(eye + (t + 0.001 * stride) * direction, vec3(0.0), dims - 1.001);
      ivec3 block = ivec3(p / blockSize);
      vec3 low = vec3(block) * blockSize;
      vec3 exits = (low + step(vec3(0.0), direction) * blockSize - eye) / direction;
      blockEnd = min(min(exits.x, exits.y), exits.z);
      vec2 range = texelFetch(blocks, block, 0).rg;
      if (iso <= range.x || iso > range.y) {
        isInside = iso <= range.x;
        t = max(blockEnd, t + 0.01 * stride);
        continue;
      }
    }
    float next = min(t + stride, end);
    if ((valueAt(eye + next * direction) >= iso) == isInside) {
      t = next;
      continue;
    }
    for (int n = 0; n < halvings; n++) {
      float middle = 0.5 * (t + next);
      if ((valueAt(eye + middle * direction) >= iso) == isInside) t = middle;
      else next = middle;
    }
    pixel = shaded(eye + next * direction);
    return;
  }
  discard;
}
`;
