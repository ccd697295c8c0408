// Turns a camera so that a cut is seen.
import { Vector3 } from 'three';
import type { Vec3 } from '../api/types';
import type { CameraPlace } from './views';

// The cosine of the angle between the view and the way into the cut below which the cut is not seen.
const leastFacing = 0.25;
const cutAngle = 0.9;

// The same place where the cut of that normal, which points to what stays, is seen from there; else another one.
export function facing(place: CameraPlace, normalOfCut: Vec3): CameraPlace {
  const normal = new Vector3(...normalOfCut);
  const away = new Vector3(...place.offset);
  const distance = away.length();
  const into = -away.dot(normal) / distance;
  if (into >= leastFacing) return place;
  const aside = away.addScaledVector(normal, into * distance);
  if (aside.length() < 1e-3 * distance) aside.set(-normal.z, 0.1, normal.x).projectOnPlane(normal);
  aside.setLength(distance * Math.sin(cutAngle)).addScaledVector(normal, -distance * Math.cos(cutAngle));
  return { offset: [aside.x, aside.y, aside.z], target: place.target };
}
