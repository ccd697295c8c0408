import { describe, expect, it } from 'vitest';
import type { Vec3 } from '@/api/types';
import { cross, dot } from '@/volume/geometry';
import { lineIn, obliqueFrame, sectionOf, spanOf, through, type Angles } from '@/volume/oblique';

const degrees = Math.PI / 180;
const axial: Vec3 = [0, 0, 1];
const coronal: Vec3 = [0, 1, 0];
const sagittal: Vec3 = [1, 0, 0];

function expectClose(a: Vec3, b: Vec3): void {
  a.forEach((value, axis) => expect(value).toBeCloseTo(b[axis as 0], 6));
}

describe('an oblique plane', () => {
  it('is seen as radiologists look where it is one of the usual ones', () => {
    const front = obliqueFrame({ turn: 0, tilt: 0 });
    expectClose(front.right, [1, 0, 0]);
    expectClose(front.down, [0, 0, -1]);
    expectClose(front.normal, [0, -1, 0]);
    const side = obliqueFrame({ turn: 90 * degrees, tilt: 0 });
    expectClose(side.right, [0, 1, 0]);
    const below = obliqueFrame({ turn: 0, tilt: 90 * degrees });
    expectClose(below.down, [0, 1, 0]);
    expectClose(below.normal, [0, 0, -1]);
  });

  it('has three directions at right angles', () => {
    for (const angles of [{ turn: 0.3, tilt: 0.7 }, { turn: -1.2, tilt: -0.4 }]) {
      const { right, down, normal } = obliqueFrame(angles);
      expectClose(cross(right, down), normal.map((value) => -value) as Vec3);
      for (const vector of [right, down, normal]) expect(Math.hypot(...vector)).toBeCloseTo(1, 9);
    }
  });

  it('cuts each slice along a line, by which it is turned and tilted', () => {
    const angles: Angles = { turn: 20 * degrees, tilt: 10 * degrees };
    expect(lineIn({ turn: 0, tilt: 0 }, coronal)).toBeNull();
    for (const slice of [axial, coronal, sagittal]) {
      const line = lineIn(angles, slice) as Vec3;
      expect(dot(line, obliqueFrame(angles).normal)).toBeCloseTo(0, 9);
      expect(dot(line, slice)).toBeCloseTo(0, 9);
      // Held where it is, it stays as it is; from the other side, too.
      for (const side of [1, -1]) {
        const same = through(angles, line.map((value) => side * value) as Vec3, slice);
        expect([same.turn, same.tilt]).toEqual([expect.closeTo(angles.turn, 9), expect.closeTo(angles.tilt, 9)]);
      }
    }
    expect(through(angles, [1, 1, 0], axial).turn).toBeCloseTo(45 * degrees, 9);
    const tilted = through(angles, [0, 1, 1], sagittal);
    expect(tilted.turn).toBe(angles.turn);
    expect(dot(obliqueFrame(tilted).normal, [0, 1, 1])).toBeCloseTo(0, 9);
  });
});

describe('what a plane cuts out of a box', () => {
  const corner = (bits: number): Vec3 => [bits & 1 ? 2 : 0, bits & 2 ? 4 : 0, bits & 4 ? 6 : 0];

  it('is a polygon around its middle', () => {
    const flat = sectionOf(corner, [0, 0, 1], 3);
    expect(flat).toHaveLength(4);
    for (const [, , z] of flat) expect(z).toBeCloseTo(3, 9);
    const side = Math.sqrt(1 / 3);
    const six = sectionOf(corner, [side, side, side], 6 * side);
    expect(six.length).toBeGreaterThanOrEqual(5);
    // Its corners follow each other around.
    const { right, down } = spanOf([side, side, side]);
    let area = 0;
    six.forEach((point, at) => {
      const next = six[(at + 1) % six.length] as Vec3;
      area += (dot(point, right) * dot(next, down) - dot(next, right) * dot(point, down)) / 2;
    });
    expect(area).toBeGreaterThan(5);
    expect(sectionOf(corner, [0, 0, 1], 7)).toEqual([]);
  });

  it('lies in a plane that two vectors span', () => {
    for (const normal of [[0, 0, 1], [0.6, 0, 0.8], [1, 0, 0]] as Vec3[]) {
      const { right, down } = spanOf(normal);
      expect([dot(right, normal), dot(down, normal), dot(right, down)].map(Math.abs)).toEqual([expect.closeTo(0, 9), expect.closeTo(0, 9), expect.closeTo(0, 9)]);
      expect(Math.hypot(...right)).toBeCloseTo(1, 9);
    }
  });
});
