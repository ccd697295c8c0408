// A volume's values where the samples of another one's slice lie in the patient, and through a slab around that slice.
import type { Axis, Vec3, Volume } from '../api/types';
import { axisIndex, pictureAxes, toPatient, toSamples } from './geometry';
import type { Preview } from './preview';

export type Projection = 'maximum' | 'mean';

export interface Slab {
  // In samples of the slice's volume, at each side of the slice.
  reach: number;
  projection: Projection;
}

export interface Resliced {
  width: number;
  height: number;
  // 0 where there is no volume.
  values: Uint8Array<ArrayBuffer>;
}

// In samples of the preview: where the first sample of a slice is, and where a step along each of the volume's axes leads.
function stepsIn({ dims, origin, steps }: Preview, volume: Volume): { at: (place: Vec3) => Vec3; step: (axis: number) => Vec3 } {
  const direction = [0, 1, 2].flatMap((row) => steps.map((step) => step[row as 0]));
  const geometry = { dims, origin, spacing: [1, 1, 1] as Vec3, direction };
  const at = (place: Vec3): Vec3 => toSamples(geometry, toPatient(volume, place));
  const zero = at([0, 0, 0]);
  const step = (axis: number): Vec3 => {
    const end = at([0, 1, 2].map((one) => (one === axis ? 1 : 0)) as Vec3);
    return end.map((value, one) => value - zero[one as 0]) as Vec3;
  };
  return { at, step };
}

// Trilinear; 0 farther than half a sample outside.
function sampler({ dims, samples }: Preview): (x: number, y: number, z: number) => number {
  const [wide, high, deep] = dims;
  const [right, down, back] = [wide > 1 ? 1 : 0, high > 1 ? wide : 0, deep > 1 ? wide * high : 0];
  const inside = (value: number, count: number): number => Math.max(0, Math.min(count - 1, value));
  return (px, py, pz) => {
    if (px < -0.5 || py < -0.5 || pz < -0.5 || px > wide - 0.5 || py > high - 0.5 || pz > deep - 0.5) return 0;
    const [x, y, z] = [inside(px, wide), inside(py, high), inside(pz, deep)];
    const i = Math.max(0, Math.min(wide - 2, Math.floor(x)));
    const j = Math.max(0, Math.min(high - 2, Math.floor(y)));
    const k = Math.max(0, Math.min(deep - 2, Math.floor(z)));
    const from = (k * high + j) * wide + i;
    const line = (at: number): number => {
      const value = samples[at] as number;
      return value + ((samples[at + right] as number) - value) * (x - i);
    };
    const plane = (at: number): number => {
      const value = line(at);
      return value + (line(at + down) - value) * (y - j);
    };
    const value = plane(from);
    return value + (plane(from + back) - value) * (z - k);
  };
}

export function resliced(preview: Preview, volume: Volume, axis: Axis, index: number, slab: Slab | null = null): Resliced {
  const normal = axisIndex(axis);
  const [across, downwards] = pictureAxes(axis);
  const [width, height] = [volume.dims[across], volume.dims[downwards]];
  const { at, step } = stepsIn(preview, volume);
  const [u, v, w] = [step(across), step(downwards), step(normal)];
  const low = Math.max(0, index - (slab?.reach ?? 0));
  const high = Math.min(volume.dims[normal] - 1, index + (slab?.reach ?? 0));
  const [x0, y0, z0] = at([0, 1, 2].map((one) => (one === normal ? low : 0)) as Vec3);
  const sample = sampler(preview);
  const values = new Uint8Array(width * height);
  const isMean = slab?.projection === 'mean';
  for (let row = 0; row < height; row += 1) {
    for (let column = 0; column < width; column += 1) {
      let [x, y, z] = [x0 + column * u[0] + row * v[0], y0 + column * u[1] + row * v[1], z0 + column * u[2] + row * v[2]];
      let most = 0;
      let sum = 0;
      for (let layer = low; layer <= high; layer += 1) {
        const value = sample(x, y, z);
        sum += value;
        if (value > most) most = value;
        x += w[0];
        y += w[1];
        z += w[2];
      }
      values[row * width + column] = Math.round(isMean ? sum / (high - low + 1) : most);
    }
  }
  return { width, height, values };
}
