// The iso-surface of a volume, or a look through it, by ray-casting: each pixel's ray goes through the samples until they cross the
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
// Whether what is looked through is drawn: colours and opacities of 256 values, and for each the sum of those below it.
uniform bool isThrough;
// True if samples are numbers of labels. The same table has their colours, and no interpolation is made between them.
uniform bool isOfLabels;
// What of the volume is drawn.
uniform bool isCropped;
uniform vec3 cropLow;
uniform vec3 cropHigh;
uniform sampler2D look;
uniform sampler2D sums;
// How much only borders between values are seen.
uniform float edges;
in vec3 place;
out vec4 pixel;

const int mostSteps = 2048;
const int halvings = 5;

float valueAt(vec3 p) {
  return texture(samples, (p + 0.5) / dims).r;
}

vec3 slopeAt(vec3 p) {
  return vec3(
    valueAt(p + vec3(1, 0, 0)) - valueAt(p - vec3(1, 0, 0)),
    valueAt(p + vec3(0, 1, 0)) - valueAt(p - vec3(0, 1, 0)),
    valueAt(p + vec3(0, 0, 1)) - valueAt(p - vec3(0, 0, 1)));
}

// Either side is seen.
vec3 seenNormal(vec3 slope) {
  vec3 normal = toNormal * slope;
  float size = length(normal);
  vec3 unit = size > 0.0 ? normal / size : towardsEye;
  return dot(unit, towardsEye) < 0.0 ? -unit : unit;
}

float shineOf(vec3 normal) {
  return pow(max(0.0, dot(normal, normalize(towardsLight + towardsEye))), 24.0);
}

vec4 shaded(vec3 p) {
  vec3 normal = seenNormal(slopeAt(p));
  float diffuse = 0.28 + 0.78 * max(0.0, dot(normal, towardsLight));
  return vec4(colour * diffuse + 0.10 * shineOf(normal), 1.0);
}

// The place at which the ray leaves its block, and the values in that block.
float blockEndAt(vec3 direction, float t, float stride, out vec2 range) {
  vec3 p = clamp(eye + (t + 0.001 * stride) * direction, vec3(0.0), dims - 1.001);
  ivec3 block = ivec3(p / blockSize);
  vec3 low = vec3(block) * blockSize;
  vec3 exits = (low + step(vec3(0.0), direction) * blockSize - eye) / direction;
  range = texelFetch(blocks, block, 0).rg;
  return min(min(exits.x, exits.y), exits.z);
}

bool hasAny(vec2 range) {
  ivec2 ends = ivec2(round(255.0 * range));
  return texelFetch(sums, ivec2(ends.y + 1, 0), 0).r > texelFetch(sums, ivec2(ends.x, 0), 0).r;
}

// One sample's light: its colour times its opacity, and the opacity.
vec4 seenAt(vec3 p, float stride) {
  vec4 here = texture(look, vec2((255.0 * valueAt(p) + 0.5) / 256.0, 0.5));
  if (here.a <= 0.0) return vec4(0.0);
  vec3 slope = 0.5 * slopeAt(p);
  vec3 normal = seenNormal(slope);
  float light = 0.35 + 0.7 * max(0.0, dot(normal, towardsLight));
  // What hardly changes has no border to be lit.
  float isBorder = clamp(length(slope) * 24.0, 0.0, 1.0);
  float opacity = here.a * mix(1.0, isBorder, edges);
  opacity = 1.0 - pow(1.0 - min(opacity, 0.999), stride);
  return vec4((here.rgb * mix(0.75, light, isBorder) + 0.12 * shineOf(normal) * isBorder) * opacity, opacity);
}

vec4 lookedThrough(vec3 direction, float t, float end, float stride) {
  vec4 seen = vec4(0.0);
  float blockEnd = -1.0;
  // Each ray begins at another place, or steps would be seen as rings.
  t += stride * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  for (int i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      vec2 range;
      blockEnd = blockEndAt(direction, t, stride, range);
      if (!hasAny(range)) {
        t += max(1.0, ceil((blockEnd - t) / stride)) * stride;
        continue;
      }
    }
    vec4 here = seenAt(eye + t * direction, reach);
    seen += (1.0 - seen.a) * here;
    if (seen.a > 0.985) break;
    t += stride;
  }
  return seen;
}

vec4 labelAt(vec3 p) {
  ivec3 nearest = ivec3(clamp(floor(p + 0.5), vec3(0.0), dims - 1.0));
  return texelFetch(look, ivec2(round(255.0 * texelFetch(samples, nearest, 0).r), 0), 0);
}

// Turned to where nothing is seen around it.
vec3 openAround(vec3 p) {
  vec3 open = vec3(0.0);
  for (int i = 0; i < 27; i++) {
    vec3 offset = vec3(i % 3, (i / 3) % 3, i / 9) - 1.0;
    if (labelAt(p + 1.5 * offset).a <= 0.0) open += offset / max(1.0, length(offset));
  }
  return open;
}

// The first label that is met.
vec4 labelled(vec3 direction, float t, float end, float stride) {
  float blockEnd = -1.0;
  for (int i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      vec2 range;
      blockEnd = blockEndAt(direction, t, stride, range);
      if (!hasAny(range)) {
        t = max(blockEnd, t + 0.01 * stride);
        continue;
      }
    }
    vec3 p = eye + t * direction;
    vec4 here = labelAt(p);
    if (here.a > 0.0) {
      return vec4(here.rgb * (0.32 + 0.74 * max(0.0, dot(seenNormal(openAround(p)), towardsLight))), 1.0);
    }
    t += stride;
  }
  return vec4(0.0);
}

bool isInsideAt(vec3 direction, float t) {
  return valueAt(eye + t * direction) >= iso;
}

vec4 surface(vec3 direction, float t, float end, float stride) {
  bool isInside = isInsideAt(direction, t);
  float blockEnd = -1.0;
  // A crop closes the surface where it is cut.
  if (isCropped && isInside) return vec4(0.62 * colour, 1.0);
  for (int i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      vec2 range;
      blockEnd = blockEndAt(direction, t, stride, range);
      if (iso <= range.x || iso > range.y) {
        isInside = iso <= range.x;
        t = max(blockEnd, t + 0.01 * stride);
        continue;
      }
    }
    float next = min(t + stride, end);
    if (isInsideAt(direction, next) == isInside) {
      t = next;
      continue;
    }
    for (int n = 0; n < halvings; n++) {
      float middle = 0.5 * (t + next);
      if (isInsideAt(direction, middle) == isInside) t = middle;
      else next = middle;
    }
    return shaded(eye + next * direction);
  }
  return vec4(0.0);
}

void main() {
  vec3 direction = place - eye;
  vec3 first = (cropLow - eye) / direction;
  vec3 second = (cropHigh - eye) / direction;
  vec3 enter = min(first, second);
  vec3 leave = max(first, second);
  float t = max(max(enter.x, enter.y), max(enter.z, 0.0));
  float end = min(min(leave.x, leave.y), leave.z);
  if (!(t < end)) discard;

  float stride = reach / max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
  if (isOfLabels) pixel = labelled(direction, t, end, stride);
  else if (isThrough) pixel = lookedThrough(direction, t, end, stride);
  else pixel = surface(direction, t, end, stride);
  if (pixel.a < 0.004) discard;
}
`;
