// A volume's values where the samples of another one's slice lie in the patient, and through a slab around that slice.
import type { Axis, Vec3, Volume } from '../api/types';
import { axisDirection, axisIndex, cross, dot, pictureAxes, toPatient, toSamples } from './geometry';
import { sampler, type Preview } from './preview';

export type Projection = 'maximum' | 'mean';

export interface Slab {
  // In millimetres, half of it at each side of the slice.
  thickness: number;
  projection: Projection;
}

export interface Resliced {
  width: number;
  height: number;
  // 0 where there is no volume.
  values: Uint8Array<ArrayBuffer>;
}

// Where a point of the patient is in samples of the preview, and where a step leads.
function inSamplesOf({ dims, origin, steps }: Preview): { at: (point: Vec3) => Vec3; step: (vector: Vec3) => Vec3 } {
  const direction = [0, 1, 2].flatMap((row) => steps.map((step) => step[row as 0]));
  const geometry = { dims, origin, spacing: [1, 1, 1] as Vec3, direction };
  const at = (point: Vec3): Vec3 => toSamples(geometry, point);
  const zero = at([0, 0, 0]);
  return { at, step: (vector) => at(vector).map((value, axis) => value - zero[axis as 0]) as Vec3 };
}

// 0 farther than half a sample outside.
function nearest({ dims, samples }: Preview): (x: number, y: number, z: number) => number {
  const [wide, high, deep] = dims;
  return (px, py, pz) => {
    const [x, y, z] = [Math.round(px), Math.round(py), Math.round(pz)];
    if (x < 0 || y < 0 || z < 0 || x >= wide || y >= high || z >= deep) return 0;
    return samples[(z * high + y) * wide + x] as number;
  };
}

interface Layer {
  // In steps along the normal.
  at: number;
  // Its part of the mean.
  part: number;
}

// A picture of a plane, whose layers lie behind each other.
interface Layers {
  width: number;
  height: number;
  // The middle of the first sample of the layer at 0, and where a step along rows, columns and the normal leads, in millimetres.
  first: Vec3;
  steps: [Vec3, Vec3, Vec3];
  layers: readonly Layer[];
  projection: Projection;
  // Between samples: the nearest one's value, as numbers of labels need it.
  isNearest?: boolean;
}

function projected(preview: Preview, { width, height, first, steps, layers, projection, isNearest = false }: Layers): Resliced {
  const { at: placeOf, step } = inSamplesOf(preview);
  const [u, v, w] = steps.map(step) as [Vec3, Vec3, Vec3];
  const [x0, y0, z0] = placeOf(first);
  const sample = isNearest ? nearest(preview) : sampler(preview);
  const values = new Uint8Array(width * height);
  for (let row = 0; row < height; row += 1) {
    for (let column = 0; column < width; column += 1) {
      const [x, y, z] = [x0 + column * u[0] + row * v[0], y0 + column * u[1] + row * v[1], z0 + column * u[2] + row * v[2]];
      let most = 0;
      let mean = 0;
      for (const { at, part } of layers) {
        const value = sample(x + at * w[0], y + at * w[1], z + at * w[2]);
        mean += part * value;
        if (value > most) most = value;
      }
      values[row * width + column] = Math.round(projection === 'mean' ? mean : most);
    }
  }
  return { width, height, values };
}

// The distance between neighbouring slices. Those of a tilted gantry lean, and lie nearer to each other than their samples.
function sliceDistance(volume: Volume, axis: Axis): number {
  const normal = axisIndex(axis);
  const [across, downwards] = pictureAxes(axis);
  const upright = cross(axisDirection(volume, across), axisDirection(volume, downwards));
  return (volume.spacing[normal] * Math.abs(dot(axisDirection(volume, normal), upright))) / Math.hypot(...upright);
}

// The ends of the slab and all slices between them. Values between slices are interpolated linearly, so the maximum of the slab is
// at one of these layers, and its mean is that of the trapezoids between them.
function layersOf(middle: number, reach: number, last: number): Layer[] {
  const low = Math.max(0, middle - reach);
  const high = Math.min(last, middle + reach);
  if (low === high) return [{ at: low, part: 1 }];
  const places = [low];
  for (let at = Math.floor(low) + 1; at < high; at += 1) places.push(at);
  places.push(high);
  return places.map((at, index) => ({ at, part: ((places[index + 1] ?? at) - (places[index - 1] ?? at)) / (2 * (high - low)) }));
}

export function resliced(preview: Preview, volume: Volume, axis: Axis, index: number, slab: Slab | null = null, isNearest = false): Resliced {
  const normal = axisIndex(axis);
  const [across, downwards] = pictureAxes(axis);
  const reach = slab ? slab.thickness / sliceDistance(volume, axis) / 2 : 0;
  const stepAlong = (one: 0 | 1 | 2): Vec3 => axisDirection(volume, one).map((value) => value * volume.spacing[one]) as Vec3;
  return projected(preview, {
    width: volume.dims[across],
    height: volume.dims[downwards],
    first: toPatient(volume, [0, 0, 0]),
    steps: [stepAlong(across), stepAlong(downwards), stepAlong(normal)],
    layers: layersOf(index, reach, volume.dims[normal] - 1),
    projection: slab?.projection ?? 'maximum',
    isNearest,
  });
}

// That of the sample at a point of the patient; 0 outside.
export function nearestValue(preview: Preview, point: Vec3): number {
  return nearest(preview)(...inSamplesOf(preview).at(point));
}

export interface Square {
  middle: Vec3;
  right: Vec3;
  down: Vec3;
  // Of a side, in millimetres and in pixels.
  size: number;
  pixels: number;
}

// The values in a square of the patient.
export function sampledSquare(preview: Preview, { middle, right, down, size, pixels }: Square, isNearest = false): Resliced {
  const step = size / pixels;
  const half = (pixels - 1) / 2;
  const scaled = (vector: Vec3): Vec3 => vector.map((value) => value * step) as Vec3;
  const [u, v] = [scaled(right), scaled(down)];
  const first = middle.map((value, axis) => value - half * (u[axis as 0] + v[axis as 0])) as Vec3;
  return projected(preview, { width: pixels, height: pixels, first, steps: [u, v, [0, 0, 0]], layers: [{ at: 0, part: 1 }], projection: 'maximum', isNearest });
}
