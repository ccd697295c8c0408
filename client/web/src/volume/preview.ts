// A volume reduced by the daemon, as the page draws it while an iso-value is looked for.
import type { Vec3 } from '../api/types';
import { LabelMap, type MappedLabel } from './label_map';
import type { Window } from './slices';

export interface Preview {
  dims: Vec3;
  // The middle of sample (0,0,0), and where a step along each axis leads, in LPS millimetres.
  origin: Vec3;
  steps: [Vec3, Vec3, Vec3];
  samples: Uint8Array<ArrayBuffer>;
  // Of which value 0 and which 255 is.
  window: Window;
  // The least and the greatest value of each block, one after the other.
  blocks: Uint8Array<ArrayBuffer>;
  blockDims: Vec3;
}

// Samples along a block; neighbours share those of their common side, so that no surface lies between two.
export const blockSize = 8;

export function triple(text: string | undefined): Vec3 {
  const numbers = (text ?? '').split(/[\s,]+/).map(Number);
  if (numbers.length !== 3 || !numbers.every(Number.isFinite)) throw new Error('The preview has an unknown format.');
  return numbers as Vec3;
}

// Reads what the daemon sends: an NRRD file of bytes.
export function previewOf(file: ArrayBuffer, window: Window): Preview {
  const bytes = new Uint8Array(file);
  const headEnd = bytes.findIndex((byte, at) => byte === 10 && bytes[at + 1] === 10) + 2;
  const fields = new Map(
    new TextDecoder()
      .decode(bytes.subarray(0, Math.max(2, headEnd)))
      .split('\n')
      .map((line) => line.split(': ', 2) as [string, string]),
  );
  const dims = triple(fields.get('sizes'));
  const samples = bytes.subarray(headEnd);
  if (headEnd < 2 || samples.length !== dims[0] * dims[1] * dims[2]) throw new Error('The preview ends too early.');
  const vectors = [...(fields.get('space directions') ?? '').matchAll(/\(([^)]*)\)/g)].map(([, inner]) => triple(inner));
  if (vectors.length !== 3) throw new Error('The preview has no position.');
  return {
    dims,
    origin: triple(fields.get('space origin')?.replace(/[()]/g, '')),
    steps: vectors as [Vec3, Vec3, Vec3],
    samples,
    window,
    ...blocksOf(samples, dims),
  };
}

// The same for labels: the samples are their numbers in the map, of which there are at most 255. There is a file for each of
// the map's windows.
export function labelPreviewOf(files: readonly ArrayBuffer[], labels: readonly MappedLabel[]): Preview {
  const map = new LabelMap(labels);
  const numbers: { samples: Uint8Array<ArrayBuffer> | null } = { samples: null };
  let made: Preview | null = null;
  files.forEach((file, at) => {
    const window = map.windows[at];
    if (!window) return;
    made = previewOf(file, window);
    numbers.samples ??= new Uint8Array(made.samples.length);
    map.take(made.samples, window, numbers.samples);
  });
  const { samples } = numbers;
  const last = made as Preview | null;
  if (!last || !samples) throw new Error('There are no labels.');
  return { ...last, samples, window: [NaN, NaN], ...blocksOf(samples, last.dims) };
}

export function blocksOf(samples: Uint8Array, dims: Vec3): Pick<Preview, 'blocks' | 'blockDims'> {
  const blockDims = dims.map((count) => Math.max(1, Math.ceil((count - 1) / blockSize))) as Vec3;
  const [across, down, deep] = blockDims;
  const blocks = new Uint8Array(2 * across * down * deep);
  const end = (block: number, axis: 0 | 1 | 2): number => Math.min(dims[axis] - 1, (block + 1) * blockSize);
  let at = 0;
  for (let bz = 0; bz < deep; bz += 1) {
    for (let by = 0; by < down; by += 1) {
      for (let bx = 0; bx < across; bx += 1) {
        let low = 255;
        let high = 0;
        for (let z = bz * blockSize; z <= end(bz, 2); z += 1) {
          for (let y = by * blockSize; y <= end(by, 1); y += 1) {
            const row = (z * dims[1] + y) * dims[0];
            const last = row + end(bx, 0);
            for (let i = row + bx * blockSize; i <= last; i += 1) {
              const value = samples[i] as number;
              if (value < low) low = value;
              if (value > high) high = value;
            }
          }
        }
        blocks[at] = low;
        blocks[at + 1] = high;
        at += 2;
      }
    }
  }
  return { blocks, blockDims };
}

// An iso-value in parts of the preview's window.
export function inPreview({ window: [low, high] }: Pick<Preview, 'window'>, iso: number): number {
  return (iso - low) / (high - low || 1);
}

// The value between samples, trilinear; 0 farther than half a sample outside.
export function sampler({ dims, samples }: Pick<Preview, 'dims' | 'samples'>): (x: number, y: number, z: number) => number {
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

// The first sample that the ray comes to of which something is seen, by the opacities of the numbers; null for none.
export function firstLabel({ dims, samples }: Pick<Preview, 'dims' | 'samples'>, table: Uint8Array, from: Vec3, direction: Vec3): Vec3 | null {
  const step = 0.5 / Math.max(...direction.map(Math.abs));
  const reach = (Math.hypot(...from) + Math.hypot(...dims)) / Math.hypot(...direction);
  for (let part = 0; part < reach; part += step) {
    const place = from.map((value, axis) => Math.round(value + part * direction[axis as 0])) as Vec3;
    if (place.some((value, axis) => value < 0 || value >= dims[axis as 0])) continue;
    const number = samples[(place[2] * dims[1] + place[1]) * dims[0] + place[0]] as number;
    if ((table[4 * number + 3] ?? 0) > 0) return place;
  }
  return null;
}

// Where the ray first meets the surface, in samples; null where it does not.
export function firstCrossing(preview: Preview, iso: number, from: Vec3, direction: Vec3): Vec3 | null {
  let near = 0;
  let far = Infinity;
  for (const axis of [0, 1, 2] as const) {
    const ends = [-from[axis] / direction[axis], (preview.dims[axis] - 1 - from[axis]) / direction[axis]] as const;
    if (ends.some(Number.isNaN)) continue;
    near = Math.max(near, Math.min(...ends));
    far = Math.min(far, Math.max(...ends));
  }
  const step = 1 / Math.max(...direction.map(Math.abs));
  const at = (part: number): Vec3 => from.map((value, axis) => value + part * direction[axis as 0]) as Vec3;
  const sample = sampler(preview);
  const isInside = (part: number): boolean => sample(...at(part)) >= 255 * iso;
  if (!(near < far)) return null;
  const began = isInside(near);
  for (let part = near; part < far; part += step) {
    let next = Math.min(far, part + step);
    if (isInside(next) === began) continue;
    for (let halving = 0; halving < 6; halving += 1) {
      const middle = (part + next) / 2;
      if (isInside(middle) === began) part = middle;
      else next = middle;
    }
    return at(next);
  }
  return null;
}
