import { describe, expect, it } from 'vitest';
import type { Vec3, Volume } from '@/api/types';
import { axisIndex, toPatient } from '@/volume/geometry';
import type { Preview } from '@/volume/preview';
import { nearestValue, resliced } from '@/volume/reslice';

// 4 a millimetre along the patient's first axis and 2 along its third, on a lattice of its own: 2 mm steps, turned and mirrored.
function ramp(): Preview {
  const dims: Vec3 = [20, 16, 18];
  const origin: Vec3 = [38, 0, 0];
  const steps: [Vec3, Vec3, Vec3] = [[0, 0, 2], [0, 2, 0], [-2, 0, 0]];
  const samples = new Uint8Array(dims[0] * dims[1] * dims[2]);
  let at = 0;
  for (let k = 0; k < dims[2]; k += 1) {
    for (let j = 0; j < dims[1]; j += 1) {
      for (let i = 0; i < dims[0]; i += 1) samples[at++] = 4 * (38 - 2 * k) + 2 * (2 * i);
    }
  }
  return { dims, origin, steps, samples, window: [0, 255], blocks: new Uint8Array(0), blockDims: [0, 0, 0] };
}

const volume = { dims: [10, 12, 14], spacing: [1, 1.5, 0.5], origin: [10, 4, 6], direction: [1, 0, 0, 0, 1, 0, 0, 0, 1] } as unknown as Volume;

describe('a slice of another volume', () => {
  it('has no numbers between those of labels', () => {
    const preview = { ...ramp(), samples: ramp().samples.map((_, at) => (at % 20 < 5 ? 1 : 5)) };
    const { values } = resliced(preview, volume, 'y', 5, null, true);
    expect(new Set(values)).toEqual(new Set([1, 5]));
    // Its lattice's first axis is the patient's third: the fifth of steps of 2 mm.
    expect([8, 10, -9, 200].map((z) => nearestValue(preview, [10, 10, z]))).toEqual([1, 5, 0, 0]);
  });

  it.each(['x', 'y', 'z'] as const)('has its values where they lie in the patient, along %s', (axis) => {
    const index = 5;
    const { width, height, values } = resliced(ramp(), volume, axis, index);
    const normal = axisIndex(axis);
    const [across, down] = [0, 1, 2].filter((one) => one !== normal) as [0, 1];
    expect([width, height]).toEqual([volume.dims[across], volume.dims[down]]);
    for (const [column, row] of [[0, 0], [width - 1, 0], [3, height - 1], [4, 5]] as const) {
      const place: Vec3 = [0, 0, 0];
      place[normal] = index;
      place[across] = column;
      place[down] = row;
      const [x, , z] = toPatient(volume, place);
      expect(Math.abs((values[row * width + column] ?? 0) - (4 * x + 2 * z))).toBeLessThanOrEqual(0.51);
    }
  });

  it('is empty beside that volume', () => {
    const far: Volume = { ...volume, origin: [-100, 4, 6] };
    expect(resliced(ramp(), far, 'z', 5).values.every((value) => value === 0)).toBe(true);
  });

  it('has the maximum or the mean of a slab, which ends where the volume does', () => {
    const at = (projection: 'maximum' | 'mean', index: number): number => resliced(ramp(), volume, 'z', index, { thickness: 4, projection }).values[0] ?? 0;
    // 4 x 10 mm, and 2 a millimetre over 6, 6.5, ...
    expect(at('maximum', 5)).toBe(40 + Math.round(2 * (6 + 0.5 * 9)));
    expect(at('mean', 5)).toBe(40 + Math.round(2 * (6 + 0.5 * 5)));
    expect(at('maximum', 13)).toBe(40 + Math.round(2 * (6 + 0.5 * 13)));
  });
});

// The samples of that volume as they are.
function previewOf({ dims, spacing, origin, direction }: Volume, valueAt: (i: number, j: number, k: number) => number): Preview {
  const step = (axis: number): Vec3 => [0, 1, 2].map((row) => (direction[3 * row + axis] ?? 0) * (spacing[axis] ?? 0)) as Vec3;
  const samples = new Uint8Array(dims[0] * dims[1] * dims[2]).map((_, at) => valueAt(at % dims[0], Math.floor(at / dims[0]) % dims[1], Math.floor(at / dims[0] / dims[1])));
  return { dims, origin, steps: [step(0), step(1), step(2)], samples, window: [0, 255], blocks: new Uint8Array(0), blockDims: [0, 0, 0] };
}

describe('a slab', () => {
  const brightAt = (spacing: number, direction = volume.direction): { thick: Volume; preview: Preview } => {
    const thick: Volume = { ...volume, dims: [3, 3, 12], spacing: [1, 1, spacing], direction };
    return { thick, preview: previewOf(thick, (_i, _j, k) => (k === 7 ? 240 : 0)) };
  };

  it.each([8, 5, 3, 1])('has its thickness in millimetres where slices are %i mm apart', (spacing) => {
    const { thick, preview } = brightAt(spacing);
    for (const thickness of [5, 10, 20, 40]) {
      for (const index of [7, 6, 5, 4]) {
        // Values rise in a line from the slice before the bright one.
        const gap = Math.max(0, (7 - index) * spacing - thickness / 2) / spacing;
        const { values } = resliced(preview, thick, 'z', index, { thickness, projection: 'maximum' });
        expect(values[4]).toBe(Math.round(240 * Math.max(0, 1 - gap)));
      }
    }
  });

  it('has the mean of its millimetres', () => {
    const { thick, preview } = brightAt(8);
    const mean = (thickness: number): number => resliced(preview, thick, 'z', 7, { thickness, projection: 'mean' }).values[4] ?? 0;
    // From the middle to 2.5 of 8 mm, and a triangle of 8 mm at each side.
    expect(mean(5)).toBe(Math.round(240 * (1 - 2.5 / 8 / 2)));
    expect(mean(40)).toBe(Math.round((240 * 8) / 40));
  });

  it('is measured at right angles to slices that lean', () => {
    const lean = Math.PI / 3;
    const { thick, preview } = brightAt(8, [1, 0, 0, 0, 1, Math.sin(lean), 0, 0, Math.cos(lean)]);
    // Neighbours are 4 mm from each other.
    expect(resliced(preview, thick, 'z', 6, { thickness: 8, projection: 'maximum' }).values[4]).toBe(240);
    expect(resliced(preview, thick, 'z', 6, { thickness: 4, projection: 'maximum' }).values[4]).toBe(120);
  });

  it.each(['x', 'y', 'z'] as const)('is nowhere darker than one of its slices, along %s', (axis) => {
    const preview = previewOf(volume, (i, j, k) => (i * 7919 + j * 104729 + k * 1299709) % 256);
    const normal = axisIndex(axis);
    const middle = 5;
    const { values } = resliced(preview, volume, axis, middle, { thickness: 4, projection: 'maximum' });
    const reach = Math.floor(2 / volume.spacing[normal]);
    for (let index = middle - reach; index <= middle + reach; index += 1) {
      const slice = resliced(preview, volume, axis, index).values;
      expect(slice.every((value, at) => value <= (values[at] ?? 0))).toBe(true);
    }
  });
});
