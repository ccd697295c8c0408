import { describe, expect, it } from 'vitest';
import type { Vec3 } from '@/api/types';
import { boxOf, cropOf, isUpright, wholeBox, within, type Box } from '@/volume/crop';
import { SliceCrop } from '@/views/slices/slice_crop';
import type { Spot } from '@/views/slices/slice_grip';

// x towards the right, y towards the back, z down.
const turned = {
  dims: [20, 30, 40] as Vec3,
  spacing: [0.5, 2, 3] as Vec3,
  origin: [7, -8, 90] as Vec3,
  direction: [-1, 0, 0, 0, 1, 0, 0, 0, -1] as [number, number, number, number, number, number, number, number, number],
};

describe('a crop', () => {
  it('is two corners in millimetres, the smallest first, and comes back as the same samples', () => {
    const box: Box = [[2, 3, 4], [10, 20, 39]];
    const crop = cropOf(turned, box);
    expect(crop).toEqual([[2, -2, -27], [6, 32, 78]]);
    expect(boxOf(turned, crop)).toEqual(box);
    expect(boxOf(turned, cropOf(turned, wholeBox(turned)))).toEqual(wholeBox(turned));
    expect(boxOf(turned, null)).toBeNull();
  });

  it('stays within the volume and never vanishes', () => {
    expect(within(turned, [[-5, 29, 7.6], [99, 29, 7.4]])).toEqual([[0, 28, 8], [19, 29, 9]]);
    expect(within({ dims: [1, 2, 3] }, [[0, 0, 0], [0, 0, 0]])).toEqual([[0, 0, 0], [0, 1, 1]]);
  });

  it('is drawn where the axes are the patient\u2019s', () => {
    expect(isUpright(turned)).toBe(true);
    expect(isUpright({ direction: [0.9, 0.1, 0, 0, 1, 0, 0, 0, 1] })).toBe(false);
  });
});

describe('the edges of a crop in a slice', () => {
  it('are caught near them and moved, but not past each other', () => {
    let box: Box = [[2, 3, 4], [10, 20, 39]];
    const { grip: crop } = new SliceCrop({ box: () => box, setBox: (next) => (box = next) }, [0, 2]);
    const at = (column: number, row: number, isTouch = false): Spot => ({ place: [column, row], pixels: [4, 4], isTouch });
    expect(crop.isAt(at(2.5, 20))).toBe(true);
    expect(crop.isAt(at(6, 20))).toBe(false);
    expect(crop.isAt(at(2, 60))).toBe(false);
    expect(crop.isAt(at(6, 20, true))).toBe(true);
    expect(crop.hold(7, at(6, 20))).toBe(false);
    // A corner is two edges.
    expect(crop.hold(7, at(2, 39))).toBe(true);
    expect(crop.move(8, at(5, 30))).toBe(false);
    expect(crop.move(7, at(5.2, 30))).toBe(true);
    expect(box).toEqual([[5, 3, 4], [10, 20, 30]]);
    crop.move(7, at(99, -99));
    expect(box).toEqual([[9, 3, 4], [10, 20, 5]]);
    expect([crop.letGo(8), crop.letGo(7), crop.move(7, at(3, 3))]).toEqual([false, true, false]);
  });
});
