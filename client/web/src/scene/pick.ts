// Where a ray meets triangles. three's own way makes objects for every one of millions. A tree of boxes
// (three-mesh-bvh) finds the place at once where it is there, but building it takes as long as a hundred
// searches through all triangles that a ray may meet, and a person measures with a few.
import type { Plane, Ray } from 'three';

// Parts of a ray, in lengths of its direction.
export interface Interval {
  from: number;
  to: number;
}

export const wholeRay: Interval = { from: 0, to: Infinity };

// The part of the ray that lies on the side of the plane to which its normal points.
export function keptBy(plane: Plane, { origin, direction }: Ray): Interval {
  const slope = plane.normal.dot(direction);
  const distance = plane.distanceToPoint(origin);
  if (slope === 0) return distance >= 0 ? wholeRay : { from: Infinity, to: Infinity };
  const meets = -distance / slope;
  return slope > 0 ? { from: Math.max(0, meets), to: Infinity } : { from: 0, to: meets };
}

export interface Met {
  at: number; // along the ray
  corner: number; // the triangle's first, in the index; -1 for none
}

// The first triangle, seen from either side, that the ray meets within the interval; at the interval's
// end when there is none. Three coordinates a vertex, three vertices a triangle.
export function firstMet(
  positions: ArrayLike<number>,
  index: ArrayLike<number>,
  { origin, direction }: Ray,
  { from, to }: Interval,
): Met {
  const { x: ox, y: oy, z: oz } = origin;
  const { x: dx, y: dy, z: dz } = direction;
  let nearest = to;
  let corner = -1;
  for (let i = 0; i + 2 < index.length; i += 3) {
    const a = 3 * (index[i] as number);
    const b = 3 * (index[i + 1] as number);
    const c = 3 * (index[i + 2] as number);
    const ax = positions[a] as number;
    const ay = positions[a + 1] as number;
    const az = positions[a + 2] as number;
    const ux = (positions[b] as number) - ax;
    const uy = (positions[b + 1] as number) - ay;
    const uz = (positions[b + 2] as number) - az;
    const vx = (positions[c] as number) - ax;
    const vy = (positions[c + 1] as number) - ay;
    const vz = (positions[c + 2] as number) - az;
    // Möller and Trumbore, Fast, minimum storage ray-triangle intersection (1997).
    const px = dy * vz - dz * vy;
    const py = dz * vx - dx * vz;
    const pz = dx * vy - dy * vx;
    const determinant = ux * px + uy * py + uz * pz;
    if (determinant === 0) continue;
    const sx = ox - ax;
    const sy = oy - ay;
    const sz = oz - az;
    const u = (sx * px + sy * py + sz * pz) / determinant;
    if (u < 0 || u > 1) continue;
    const qx = sy * uz - sz * uy;
    const qy = sz * ux - sx * uz;
    const qz = sx * uy - sy * ux;
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (v < 0 || u + v > 1) continue;
    const at = (vx * qx + vy * qy + vz * qz) / determinant;
    if (at >= from && at < nearest) {
      nearest = at;
      corner = i;
    }
  }
  return { at: nearest, corner };
}
