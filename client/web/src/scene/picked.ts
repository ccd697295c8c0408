// What of a surface and of the slice on its cut is seen at a point of the picture.
import { Raycaster, Vector2, Vector3, type Camera } from 'three';
import type { Vec3, Label } from '../api/types';
import type { Cut } from './cut';
import type { Parts } from './parts';
import { keptBy, wholeRay } from './pick';

// A point of the surface, and whose it is; null: of the only surface, or of the slice on the cut.
export interface Picked {
  point: Vec3;
  label: Label | null;
  distance?: number; // of a surface that has distances, there
  // A vertex of its triangle, as PartFinder.partOf takes it; none of a slice.
  vertex: [block: number, vertex: number] | null;
}

const caster = new Raycaster();

// The nearest point, both from -1 to 1; null where nothing is.
export function pickedAt(x: number, y: number, camera: Camera, parts: Parts, cut: Cut): Picked | null {
  caster.setFromCamera(new Vector2(x, y), camera);
  const { ray } = caster;
  const plane = parts.cut;
  const { from, to } = plane ? keptBy(plane, ray) : wholeRay;
  const slice = cut.hit(caster)?.distance ?? Infinity;
  const hit = parts.hit(ray, { from, to: Math.min(to, slice) });
  const found = hit?.at ?? slice;
  if (found === Infinity) return null;
  const point = ray.at(found, new Vector3());
  const vertex: Picked['vertex'] = hit ? [hit.block, hit.vertex] : null;
  const picked: Picked = { point: [point.x, point.y, point.z], label: hit?.label ?? null, vertex };
  return hit?.distance === undefined ? picked : { ...picked, distance: hit.distance };
}
