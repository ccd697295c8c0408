// Where the camera stands, in the patient's directions: LPS millimetres, the head up.
import type { Vec3 } from '../api/types';

export const viewNames = ['A', 'P', 'L', 'R', 'S', 'I'] as const;
export type ViewName = (typeof viewNames)[number];

export const viewTitles: Record<ViewName, string> = {
  A: 'Anterior: from the front',
  P: 'Posterior: from the back',
  L: "Left: from the patient's left",
  R: "Right: from the patient's right",
  S: 'Superior: from above',
  I: 'Inferior: from below',
};

// From the middle to the camera. The views along the head's axis lean by a hair, so that the front is
// up on the screen.
const lean = 1e-4;
export const viewOffsets: Record<ViewName, Vec3> = {
  A: [0, -1, 0],
  P: [0, 1, 0],
  L: [1, 0, 0],
  R: [-1, 0, 0],
  S: [0, lean, 1],
  I: [0, -lean, -1],
};

export interface CameraPlace {
  // From the target to the camera; its length is the distance.
  offset: Vec3;
  target: Vec3;
}

export const firstOffset: Vec3 = [0.5, -1, 0.28];

export function turned(offset: Vec3, azimuth: number, elevation: number): Vec3 {
  const radius = Math.hypot(...offset);
  if (!(radius > 0)) return offset;
  const around = Math.atan2(offset[1], offset[0]) + azimuth;
  const limit = Math.PI / 2 - lean;
  const height = Math.asin(Math.max(-1, Math.min(1, offset[2] / radius))) + elevation;
  const up = Math.max(-limit, Math.min(limit, height));
  return [
    radius * Math.cos(up) * Math.cos(around),
    radius * Math.cos(up) * Math.sin(around),
    radius * Math.sin(up),
  ];
}

// How far the camera has to be for a sphere to fill its view, angles in radians.
export function fitDistance(radius: number, verticalAngle: number, aspect: number): number {
  const horizontalAngle = 2 * Math.atan(Math.tan(verticalAngle / 2) * aspect);
  return radius / Math.sin(Math.min(verticalAngle, horizontalAngle) / 2);
}

export function placeToText({ offset, target }: CameraPlace): string {
  return [...offset, ...target].map((value) => Number(value.toPrecision(5))).join(',');
}

export function placeOfText(text: string): CameraPlace | null {
  const numbers = text.split(',').map(Number);
  if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return null;
  const [a, b, c, d, e, f] = numbers as [number, number, number, number, number, number];
  return Math.hypot(a, b, c) > 0 ? { offset: [a, b, c], target: [d, e, f] } : null;
}
