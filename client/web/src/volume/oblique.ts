// A plane through a point of the patient, at any angle: with no angles as a coronal slice is seen, turned around the patient's long
// axis and then tilted.
import type { Vec3 } from '../api/types';
import { cross, dot } from './geometry';

// In radians.
export interface Angles {
  turn: number;
  tilt: number;
}

export interface ObliqueFrame {
  right: Vec3;
  down: Vec3;
  // Towards who looks, away from the patient.
  normal: Vec3;
}

const parallel = 0.05;

export function obliqueFrame({ turn, tilt }: Angles): ObliqueFrame {
  const [sin, cos] = [Math.sin(turn), Math.cos(turn)];
  const [rise, flat] = [Math.sin(tilt), Math.cos(tilt)];
  return { right: [cos, sin, 0], down: [-sin * rise, cos * rise, -flat], normal: [sin * flat, -cos * flat, -rise] };
}

// The unit vector along which the plane cuts a slice of that normal; null where the two are nearly parallel.
export function lineIn(angles: Angles, sliceNormal: Vec3): Vec3 | null {
  const line = cross(obliqueFrame(angles).normal, sliceNormal);
  const length = Math.hypot(...line);
  return length < parallel ? null : (line.map((value) => value / length) as Vec3);
}

// Within a quarter of a turn to each side.
function halved(angle: number): number {
  return angle - Math.PI * Math.round(angle / Math.PI);
}

// The plane that holds that direction of a slice of that normal: turned in axial slices, tilted in others.
export function through(angles: Angles, direction: Vec3, sliceNormal: Vec3): Angles {
  const isAxial = Math.abs(sliceNormal[2]) > Math.max(Math.abs(sliceNormal[0]), Math.abs(sliceNormal[1]));
  if (isAxial) return { ...angles, turn: halved(Math.atan2(direction[1], direction[0])) };
  const { normal } = obliqueFrame({ turn: angles.turn, tilt: 0 });
  // The tilted normal is `normal` times the cosine, less the long axis times the sine.
  return { ...angles, tilt: halved(Math.atan2(dot(normal, direction), direction[2])) };
}

// Any two unit vectors of the plane of that normal, at a right angle.
export function spanOf(normal: Vec3): { right: Vec3; down: Vec3 } {
  // Not along the normal.
  const other: Vec3 = Math.abs(normal[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0];
  const aside = cross(other, normal);
  const right = aside.map((value) => value / Math.hypot(...aside)) as Vec3;
  return { right, down: cross(normal, right) };
}

// The corners of what the plane n . p = depth cuts out of a box, whose corner is told for three bits; around its middle, none
// where it passes by.
export function sectionOf(cornerAt: (bits: number) => Vec3, normal: Vec3, depth: number): Vec3[] {
  const corners = Array.from({ length: 8 }, (_, bits) => cornerAt(bits));
  const heights = corners.map((corner) => dot(corner, normal) - depth);
  const found: Vec3[] = [];
  for (let from = 0; from < 8; from += 1) {
    for (const bit of [1, 2, 4]) {
      const to = from | bit;
      const [a = 0, b = 0] = [heights[from], heights[to]];
      if (from === to || a >= 0 === b >= 0) continue;
      const part = a / (a - b);
      found.push((corners[from] as Vec3).map((value, axis) => value + part * ((corners[to] as Vec3)[axis as 0] - value)) as Vec3);
    }
  }
  const middle = [0, 1, 2].map((axis) => found.reduce((sum, point) => sum + point[axis as 0], 0) / Math.max(1, found.length)) as Vec3;
  const { right, down } = spanOf(normal);
  const angle = (point: Vec3): number => {
    const from = point.map((value, axis) => value - middle[axis as 0]) as Vec3;
    return Math.atan2(dot(from, down), dot(from, right));
  };
  return found.sort((a, b) => angle(a) - angle(b));
}
