// What follows from where a camera stands.
import { AmbientLight, DirectionalLight, Vector3, type Camera, type PerspectiveCamera, type Scene } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
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

// The height of the view at the point that it looks at.
export function heightOf({ offset }: Pick<CameraPlace, 'offset'>): number {
  return 2 * Math.hypot(...offset) * Math.tan((verticalAngle * Math.PI) / 360);
}

// The same view farther to the right and up, in parts of the view's height.
export function panned(camera: PerspectiveCamera, { offset, target }: CameraPlace, right: number, up: number): CameraPlace {
  const height = heightOf({ offset });
  const shift = new Vector3(right * height, up * height, 0).applyQuaternion(camera.quaternion);
  return { offset, target: [target[0] + shift.x, target[1] + shift.y, target[2] + shift.z] };
}

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

// One light goes with the camera, so that what is looked at is lit.
export function addLights(scene: Scene, camera: Camera): void {
  const headlight = new DirectionalLight(0xffffff, 2.5);
  headlight.position.set(-0.35, 0.5, 1);
  headlight.target.position.set(0, 0, -1);
  camera.add(headlight, headlight.target);
  scene.add(camera, new AmbientLight(0xffffff, 0.6));
}

export function controlsOf(camera: PerspectiveCamera, canvas: HTMLCanvasElement, on: Record<'start' | 'end' | 'change', () => void>): OrbitControls {
  const controls = new OrbitControls(camera, canvas);
  controls.zoomToCursor = true;
  controls.rotateSpeed = 0.9;
  for (const name of ['start', 'end', 'change'] as const) controls.addEventListener(name, on[name]);
  return controls;
}

export function placeOf({ position }: PerspectiveCamera, { target: { x, y, z } }: OrbitControls): CameraPlace {
  return { offset: [position.x - x, position.y - y, position.z - z], target: [x, y, z] };
}
