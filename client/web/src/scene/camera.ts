// What follows from where a camera stands.
import { Vector3, type PerspectiveCamera } from 'three';
import type { Vec3 } from '../api/types';
import type { CameraPlace } from './views';

export const verticalAngle = 30;

// Sees all of a box from there.
export function clipTo(camera: PerspectiveCamera, target: Vector3, [low, high]: readonly [Vec3, Vec3]): void {
  const distance = camera.position.distanceTo(target);
  const wide = 2 * Math.max(1e-3, Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]));
  camera.far = wide + distance;
  camera.near = Math.max(camera.far / 5000, distance - wide);
  camera.updateProjectionMatrix();
}

// The same view farther to the right and up, in parts of the view's height.
export function panned(camera: PerspectiveCamera, { offset, target }: CameraPlace, right: number, up: number): CameraPlace {
  const height = 2 * Math.hypot(...offset) * Math.tan((verticalAngle * Math.PI) / 360);
  const shift = new Vector3(right * height, up * height, 0).applyQuaternion(camera.quaternion);
  return { offset, target: [target[0] + shift.x, target[1] + shift.y, target[2] + shift.z] };
}
