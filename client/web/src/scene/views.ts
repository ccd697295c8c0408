// Where the camera stands, in the patient's directions: LPS millimetres, the head up.
import type { Vec3 } from '../api/types';
import { dot } from '../volume/geometry';

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

// From the middle to the camera. The views along the head's axis are tilted a little, so that the front is
// up on the screen.
const tilt = 1e-4;
export const viewOffsets: Record<ViewName, Vec3> = {
  A: [0, -1, 0],
  P: [0, 1, 0],
  L: [1, 0, 0],
  R: [-1, 0, 0],
  S: [0, tilt, 1],
  I: [0, -tilt, -1],
};

export interface CameraPlace {
  // From the target to the camera; its length is the distance.
  offset: Vec3;
  target: Vec3;
}

export const firstOffset: Vec3 = [0.5, -1, 0.28];
export const unitBox: [Vec3, Vec3] = [
  [-1, -1, -1],
  [1, 1, 1],
];

export function turned(offset: Vec3, azimuth: number, elevation: number): Vec3 {
  const radius = Math.hypot(...offset);
  if (!(radius > 0)) return offset;
  const around = Math.atan2(offset[1], offset[0]) + azimuth;
  const limit = Math.PI / 2 - tilt;
  const height = Math.asin(Math.max(-1, Math.min(1, offset[2] / radius))) + elevation;
  const up = Math.max(-limit, Math.min(limit, height));
  return [
    radius * Math.cos(up) * Math.cos(around),
    radius * Math.cos(up) * Math.sin(around),
    radius * Math.sin(up),
  ];
}

// How far from the middle of a box the camera has to be to see all of it, with its head up; the angle
// is the vertical one, in radians.
export function fitDistance(size: Vec3, offset: Vec3, verticalAngle: number, aspect: number): number {
  const length = Math.hypot(...offset);
  const back: Vec3 = [offset[0] / length, offset[1] / length, offset[2] / length];
  const flat = Math.hypot(back[0], back[1]) || 1;
  const right: Vec3 = [-back[1] / flat, back[0] / flat, 0];
  const up: Vec3 = [-back[2] * right[1], back[2] * right[0], back[0] * right[1] - back[1] * right[0]];
  const tangent = Math.tan(verticalAngle / 2);
  let distance = 0;
  for (let corner = 0; corner < 8; corner += 1) {
    const sign = (bit: number): number => ((corner >> bit) & 1) - 0.5;
    const point: Vec3 = [size[0] * sign(0), size[1] * sign(1), size[2] * sign(2)];
    const side = Math.max(
      Math.abs(dot(point, up)) / tangent,
      Math.abs(dot(point, right)) / (tangent * aspect),
    );
    distance = Math.max(distance, dot(point, back) + side);
  }
  return Math.max(distance, 1e-3);
}

const fill = 1.02;

// From where a camera looks from that side at all of a box; the angle is the vertical one, in radians.
export function fitted([low, high]: readonly [Vec3, Vec3], offset: Vec3, verticalAngle: number, aspect: number): CameraPlace {
  const size = high.map((value, axis) => value - low[axis as 0]) as Vec3;
  const target = high.map((value, axis) => (value + low[axis as 0]) / 2) as Vec3;
  const scale = (fill * fitDistance(size, offset, verticalAngle, aspect)) / Math.hypot(...offset);
  return { offset: offset.map((value) => value * scale) as Vec3, target };
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
