import { Plane, Ray, Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { firstMet, keptBy, wholeRay } from '../../../client/web/src/scene/pick';

// Two unit squares across z, at heights 2 and 5, wound opposite ways.
const positions = [0, 0, 2, 1, 0, 2, 1, 1, 2, 0, 1, 2, 0, 0, 5, 1, 0, 5, 1, 1, 5, 0, 1, 5];
const index = [0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6];

function up(x: number, y: number): Ray {
  return new Ray(new Vector3(x, y, 0), new Vector3(0, 0, 1));
}

describe('the first hit of a ray', () => {
  it('is the nearest one, from either side and within the triangles alone', () => {
    expect(firstMet(positions, index, up(0.7, 0.2), wholeRay).at).toBeCloseTo(2, 12);
    expect(firstMet(positions, index, up(0.2, 0.7), wholeRay).at).toBeCloseTo(2, 12);
    expect(firstMet(positions, [4, 6, 5], up(0.7, 0.2), wholeRay).at).toBeCloseTo(5, 12);
    expect(firstMet(positions, index, up(1.1, 0.2), wholeRay)).toEqual({ at: Infinity, corner: -1 });
    expect(firstMet(positions, index, up(0.2, 0.7), wholeRay).corner).toBe(3);
    const down = new Ray(new Vector3(0.5, 0.4, 9), new Vector3(0, 0, -1));
    expect(firstMet(positions, index, down, wholeRay).at).toBeCloseTo(4, 12);
    const away = new Ray(new Vector3(0.5, 0.4, 9), new Vector3(0, 0, 1));
    expect(firstMet(positions, index, away, wholeRay).at).toBe(Infinity);
  });

  it('is not one that a plane cuts away', () => {
    const above = new Plane(new Vector3(0, 0, 1), -3);
    expect(firstMet(positions, index, up(0.5, 0.4), keptBy(above, up(0.5, 0.4))).at).toBeCloseTo(5, 12);
    const below = new Plane(new Vector3(0, 0, -1), 1);
    const part = keptBy(below, up(0.5, 0.4));
    expect(part).toEqual({ from: 0, to: 1 });
    expect(firstMet(positions, index, up(0.5, 0.4), part).at).toBe(1);
    const beside = new Plane(new Vector3(1, 0, 0), -0.6);
    expect(keptBy(beside, up(0.5, 0.4)).from).toBe(Infinity);
    expect(keptBy(beside, up(0.7, 0.4))).toEqual(wholeRay);
  });
});
