import { describe, expect, it } from 'vitest';
import type { Vec3, Volume } from '@/api/types';
import { axisIndex, toPatient } from '@/volume/geometry';
import type { Preview } from '@/volume/preview';
import { resliced } from '@/volume/reslice';

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
    const at = (projection: 'maximum' | 'mean', index: number): number => resliced(ramp(), volume, 'z', index, { reach: 4, projection }).values[0] ?? 0;
    // 4 x 10 mm, and 2 a millimetre over 6, 6.5, ...
    expect(at('maximum', 5)).toBe(40 + Math.round(2 * (6 + 0.5 * 9)));
    expect(at('mean', 5)).toBe(40 + Math.round(2 * (6 + 0.5 * 5)));
    expect(at('maximum', 13)).toBe(40 + Math.round(2 * (6 + 0.5 * 13)));
  });
});
