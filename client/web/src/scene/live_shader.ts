// The iso-surface of a volume, or a look through it, by ray-casting: a box is drawn around the volume, and the ray of each of its
// pixels goes through the samples until they cross the iso-value; there the gradient tells how the surface is turned. Blocks that
// the surface does not meet are passed over at once. All places are in samples: sample (0,0,0) is at the origin.
export const kinds = { surface: 0, through: 1, labels: 2 } as const;

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
uniform mat4 toNormal;
uniform vec3 eye;
uniform float iso;
uniform vec3 towardsLight;
// In samples; a longer one may pass over what is thinner.
uniform float reach;
uniform vec3 towardsEye;
// How much only borders between values are seen.
uniform float edges;
uniform vec3 colour;
// A number of kinds.
uniform float kind;
uniform vec3 cropLow;
uniform float isCropped;
uniform float isBelow;
uniform vec3 cropHigh;
uniform float blockSize;
uniform vec3 dims;
in vec3 place;
out vec4 pixel;

vec3 select(vec3 otherwise, vec3 chosen, bool isChosen) { return isChosen ? chosen : otherwise; }
vec4 select(vec4 otherwise, vec4 chosen, bool isChosen) { return isChosen ? chosen : otherwise; }

// Between samples.
float valueAt(vec3 p) { return texture(samples, (p + 0.5) / dims).r; }
float sampleAt(ivec3 at) { return texelFetch(samples, at, 0).r; }
// The least and greatest value of a block.
vec2 rangeAt(ivec3 block) { return texelFetch(blocks, block, 0).rg; }
// The colour and opacity of a value.
vec4 tableAt(int value) { return texelFetch(look, ivec2(value, 0), 0); }
vec4 tableBetween(float value) { return texture(look, vec2((255.0 * value + 0.5) / 256.0, 0.5)); }
// The sum of the opacities of all values below.
float sumAt(int value) { return texelFetch(sums, ivec2(value, 0), 0).r; }

const int mostSteps = 2048;
const int halvings = 5;
const vec4 nothing = vec4(0.0);

vec3 slopeAt(vec3 p) {
  return vec3(
    valueAt(p + vec3(1.0, 0.0, 0.0)) - valueAt(p - vec3(1.0, 0.0, 0.0)),
    valueAt(p + vec3(0.0, 1.0, 0.0)) - valueAt(p - vec3(0.0, 1.0, 0.0)),
    valueAt(p + vec3(0.0, 0.0, 1.0)) - valueAt(p - vec3(0.0, 0.0, 1.0)));
}

// Either side is seen.
vec3 seenNormal(vec3 slope) {
  vec3 normal = (toNormal * vec4(slope, 0.0)).xyz;
  float size = length(normal);
  vec3 unit = select(towardsEye, normal / max(size, 1e-30), size > 0.0);
  return select(unit, -unit, dot(unit, towardsEye) < 0.0);
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
vec3 blockAt(vec3 direction, float t, float stride) {
  vec3 p = clamp(eye + (t + 0.001 * stride) * direction, vec3(0.0), dims - 1.001);
  ivec3 block = ivec3(p / blockSize);
  vec3 low = vec3(block) * blockSize;
  vec3 exits = (low + step(vec3(0.0), direction) * blockSize - eye) / direction;
  return vec3(min(min(exits.x, exits.y), exits.z), rangeAt(block));
}

// True if anything is seen of these values.
bool hasAny(vec2 range) {
  ivec2 ends = ivec2(round(255.0 * range));
  return sumAt(ends.y + 1) > sumAt(ends.x);
}

// One sample's light: its colour times its opacity, and the opacity.
vec4 seenAt(vec3 p, float stride) {
  vec4 here = tableBetween(valueAt(p));
  if (here.a <= 0.0) { return nothing; }
  vec3 slope = 0.5 * slopeAt(p);
  vec3 normal = seenNormal(slope);
  float light = 0.35 + 0.7 * max(0.0, dot(normal, towardsLight));
  // Values that hardly change have no border to be lit.
  float isBorder = clamp(length(slope) * 24.0, 0.0, 1.0);
  float all = here.a * mix(1.0, isBorder, edges);
  float opacity = 1.0 - pow(1.0 - min(all, 0.999), stride);
  return vec4((here.rgb * mix(0.75, light, isBorder) + 0.12 * shineOf(normal) * isBorder) * opacity, opacity);
}

vec4 lookedThrough(vec3 direction, float begin, float end, float stride, vec2 pixel) {
  vec4 seen = nothing;
  float blockEnd = -1.0;
  // Each ray begins at another place, or steps would be seen as rings.
  float t = begin + stride * fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
  for (int i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      vec3 block = blockAt(direction, t, stride);
      blockEnd = block.x;
      if (!hasAny(block.yz)) {
        t += max(1.0, ceil((blockEnd - t) / stride)) * stride;
        continue;
      }
    }
    seen += (1.0 - seen.a) * seenAt(eye + t * direction, reach);
    if (seen.a > 0.985) { break; }
    t += stride;
  }
  return select(seen, nothing, seen.a < 0.004);
}

vec4 labelAt(vec3 p) {
  return tableAt(int(round(255.0 * sampleAt(ivec3(clamp(floor(p + 0.5), vec3(0.0), dims - 1.0))))));
}

// Turned to where nothing is seen around it.
vec3 openAround(vec3 p) {
  vec3 open = vec3(0.0);
  for (int i = 0; i < 27; i++) {
    vec3 offset = vec3(ivec3(i % 3, (i / 3) % 3, i / 9)) - 1.0;
    if (labelAt(p + 1.5 * offset).a <= 0.0) { open += offset / max(1.0, length(offset)); }
  }
  return open;
}

// The first label that is met.
vec4 labelled(vec3 direction, float begin, float end, float stride) {
  float t = begin;
  float blockEnd = -1.0;
  for (int i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      vec3 block = blockAt(direction, t, stride);
      blockEnd = block.x;
      if (!hasAny(block.yz)) {
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
  return nothing;
}

bool isInsideAt(vec3 direction, float t) {
  return valueAt(eye + t * direction) >= iso;
}

vec4 surface(vec3 direction, float begin, float end, float stride) {
  float t = begin;
  bool isInside = isInsideAt(direction, t);
  float blockEnd = -1.0;
  // A crop closes the surface where it is cut.
  if (isCropped > 0.0 && isInside != (isBelow > 0.0)) { return vec4(0.62 * colour, 1.0); }
  for (int i = 0; i < mostSteps && t < end; i++) {
    if (t >= blockEnd) {
      vec3 block = blockAt(direction, t, stride);
      blockEnd = block.x;
      if (iso <= block.y || iso > block.z) {
        isInside = iso <= block.y;
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
      if (isInsideAt(direction, middle) == isInside) { t = middle; } else { next = middle; }
    }
    return shaded(eye + next * direction);
  }
  return nothing;
}

// The light along a ray from the eye; the pixel's place tells it from its neighbours.
vec4 seenAlong(vec3 direction, vec2 pixel) {
  vec3 first = (cropLow - eye) / direction;
  vec3 second = (cropHigh - eye) / direction;
  vec3 enter = min(first, second);
  vec3 leave = max(first, second);
  float begin = max(max(enter.x, enter.y), max(enter.z, 0.0));
  float end = min(min(leave.x, leave.y), leave.z);
  if (!(begin < end)) { return nothing; }
  float stride = reach / max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
  if (kind == ${kinds.surface}.0) { return surface(direction, begin, end, stride); }
  if (kind == ${kinds.through}.0) { return lookedThrough(direction, begin, end, stride, pixel); }
  return labelled(direction, begin, end, stride);
}

void main() {
  pixel = seenAlong(place - eye, gl_FragCoord.xy);
  if (pixel.a <= 0.0) discard;
}
`;
