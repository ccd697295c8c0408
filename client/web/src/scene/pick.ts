// The place where a ray meets triangles. A tree of boxes (three-mesh-bvh) finds it at once if the tree is there, but building one takes
// as long as many searches through all triangles that a ray may meet, and a person measures with a few.
import { Vector3, type Plane, type Ray } from 'three';

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
export function firstMet(positions: ArrayLike<number>, index: ArrayLike<number>, ray: Ray, { from, to }: Interval): Met {
  const [a, b, c, met] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
  const scale = 1 / ray.direction.lengthSq();
  let nearest = to;
  let corner = -1;
  for (let i = 0; i + 2 < index.length; i += 3) {
    a.fromArray(positions, 3 * (index[i] as number));
    b.fromArray(positions, 3 * (index[i + 1] as number));
    c.fromArray(positions, 3 * (index[i + 2] as number));
    if (!ray.intersectTriangle(a, b, c, false, met)) continue;
    const at = met.sub(ray.origin).dot(ray.direction) * scale;
    if (at >= from && at < nearest) {
      nearest = at;
      corner = i;
    }
  }
  return { at: nearest, corner };
}
