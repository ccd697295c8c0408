import { describe, expect, it } from 'vitest';
import type { Vec3 } from '@/api/types';
import { patientAxes, sideOf, slicePlane, toPatient } from '@/volume/geometry';

const identity = [1, 0, 0, 0, 1, 0, 0, 0, 1];
// Columns: x towards the right, y towards the front, z up, as NIfTI templates lie.
const template = [-1, 0, 0, 0, -1, 0, 0, 0, 1];
// Columns: x towards the back, y towards the feet, z towards the left: a sagittal series.
const sagittal = [0, 0, 1, 1, 0, 0, 0, -1, 0];

describe('geometry', () => {
  it('names the sides of the patient', () => {
    expect([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]].map((v) => sideOf(v as Vec3)).join('')).toBe('LRPASI');
  });

  it('has the patient right on the left and the front on top, whichever way the samples run', () => {
    for (const direction of [identity, template, sagittal]) {
      const { right, down } = slicePlane({ direction }, 'axial');
      expect([right.begin, right.end, down.begin, down.end].join('')).toBe('RLAP');
      const coronal = slicePlane({ direction }, 'coronal');
      expect([coronal.right.begin, coronal.down.begin, coronal.down.end].join('')).toBe('RSI');
    }
  });

  it('turns what runs the other way', () => {
    const { normal, right, down } = slicePlane({ direction: template }, 'axial');
    expect([normal, right.axis, right.flipped, down.axis, down.flipped]).toEqual(['z', 'x', true, 'y', true]);
    expect(slicePlane({ direction: sagittal }, 'axial')).toMatchObject({
      normal: 'y',
      right: { axis: 'z', flipped: false },
      down: { axis: 'x', flipped: false },
    });
  });

  it('gives every axis one volume axis, also when the volume lies oblique', () => {
    const half = Math.SQRT1_2;
    const oblique = [half, -half, 0, half, half, 0, 0, 0, 1];
    expect(new Set(patientAxes({ direction: oblique })).size).toBe(3);
    expect(patientAxes({ direction: sagittal })).toEqual(['z', 'x', 'y']);
  });

  it('places samples in the patient', () => {
    const volume = { dims: [9, 9, 9] as Vec3, spacing: [2, 3, 4] as Vec3, origin: [10, 20, 30] as Vec3, direction: sagittal };
    expect(toPatient(volume, [1, 1, 1])).toEqual([14, 22, 27]);
  });
});
