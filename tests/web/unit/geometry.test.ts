import { describe, expect, it } from 'vitest';
import type { Vec3 } from '@/api/types';
import { axisDirection, cursorOfText, flipped, patientAxes, placedAt, sampleAt, sideOf, slicePlacement, slicePlane, toPatient, toSamples, turned, type Placement } from '@/volume/geometry';

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

  it('flips and turns what a slice shows, whichever way the samples run', () => {
    for (const direction of [identity, template, sagittal]) {
      const corrected = (order: string): { direction: number[] } => {
        const columns = order.split(',').map((name) => axisDirection({ direction }, 'xyz'.indexOf(name.slice(-1))).map((part) => (name.startsWith('-') ? -part : part)));
        return { direction: [0, 1, 2].flatMap((row) => columns.map((column) => column[row] as number)) };
      };
      // The side where the end of an axis comes to lie, by the side where it lay.
      const moved = (order: string): string[] => [0, 1, 2].map((axis) => sideOf(axisDirection({ direction }, axis)) + sideOf(axisDirection(corrected(order), axis)));
      for (const pair of moved(flipped({ direction }, 0))) expect('LR RL AA PP SS II').toContain(pair);
      for (const pair of moved(flipped({ direction }, 2))) expect('LL RR AA PP SI IS').toContain(pair);
      // Clockwise, as a radiologist sees the patient from the feet: from the left to the back, and on to the right.
      for (const pair of moved(turned({ direction }, 'axial'))) expect('LP PR RA AL SS II').toContain(pair);
      for (const pair of moved(turned({ direction }, 'coronal'))) expect('LI IR RS SL AA PP').toContain(pair);
      for (const pair of moved(turned({ direction }, 'sagittal'))) expect('PI IA AS SP LL RR').toContain(pair);
    }
  });

  it('finds the sample of a point, also where a gantry was tilted', () => {
    const tilted = [1, 0, 0, 0, 1, Math.sin(0.3), 0, 0, Math.cos(0.3)];
    for (const direction of [identity, template, sagittal, tilted]) {
      const volume = { dims: [20, 30, 40] as Vec3, spacing: [0.5, 2, 3] as Vec3, origin: [-7, 8, 90] as Vec3, direction };
      const place: Vec3 = [3.25, 17, 30.5];
      toSamples(volume, toPatient(volume, place)).forEach((value, axis) => expect(value).toBeCloseTo(place[axis as 0], 9));
      expect(sampleAt(volume, toPatient(volume, [-4, 17.4, 99]))).toEqual([0, 17, 39]);
    }
    expect(cursorOfText('3,99,x', { dims: [20, 30, 40] })).toEqual([3, 15, 20]);
    expect(cursorOfText('', { dims: [20, 30, 40] })).toEqual([10, 15, 20]);
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

describe('a slice on the screen', () => {
  const room = { width: 200, height: 100, edge: 10 };
  const volume = (direction: number[], spacing: [number, number, number] = [1, 1, 1]) => ({
    dims: [40, 20, 10] as [number, number, number],
    spacing,
    origin: [0, 0, 0] as [number, number, number],
    direction,
  });
  const placed = ([a, b, c, d, e, f]: Placement, u: number, v: number): [number, number] => [a * u + c * v + e, b * u + d * v + f];

  it('is as large as the room allows, and lies in its middle', () => {
    const straight = volume([1, 0, 0, 0, 1, 0, 0, 0, 1]);
    const placement = slicePlacement(straight, slicePlane(straight, 'axial'), room);
    expect(placed(placement, 0, 0)).toEqual([20, 10]);
    expect(placed(placement, 40, 20)).toEqual([180, 90]);
    expect(placedAt(placement, 180, 10)).toEqual([40, 0]);
  });

  it('is turned over where the volume runs the other way', () => {
    const turned = volume([-1, 0, 0, 0, 1, 0, 0, 0, 1]);
    const placement = slicePlacement(turned, slicePlane(turned, 'coronal'), room);
    // x runs to the patient's right, which is on the left; z runs up.
    expect(placed(placement, 0, 0)[0]).toBeGreaterThan(placed(placement, 40, 0)[0]);
    expect(placed(placement, 0, 0)[1]).toBeGreaterThan(placed(placement, 0, 10)[1]);
  });

  it('leans as a tilted gantry does', () => {
    const tilt = (18.5 * Math.PI) / 180;
    // Slices lie across z, and each lies farther back than the one below it.
    const tilted = volume([1, 0, 0, 0, 1, Math.sin(tilt), 0, 0, Math.cos(tilt)]);
    const placement = slicePlacement(tilted, slicePlane(tilted, 'sagittal'), room);
    const [x0, y0] = placed(placement, 0, 0);
    const [x1, y1] = placed(placement, 0, 10);
    expect((180 * Math.atan2(x1 - x0, y0 - y1)) / Math.PI).toBeCloseTo(18.5, 6);
    const [x2, y2] = placed(placement, 20, 0);
    expect(y2).toBeCloseTo(y0, 9);
    // True proportions: ten samples along the tilted axis are half as long as twenty along the other.
    expect(Math.hypot(x1 - x0, y1 - y0)).toBeCloseTo((x2 - x0) / 2, 9);
    const [u, v] = placedAt(placement, ...placed(placement, 7, 3));
    expect(u).toBeCloseTo(7, 9);
    expect(v).toBeCloseTo(3, 9);
    // The oblique axes of a scan that is not tilted stay at right angles.
    const oblique = volume([0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0, 1]);
    const [a, b, c, d] = slicePlacement(oblique, slicePlane(oblique, 'axial'), room);
    expect(a * c + b * d).toBe(0);
  });
});
