// Lengths, angles and areas of points in millimetres.
import type { Vec3 } from '../api/types';
import { formatNumber, formatSize } from '../ui/format';
import { cross, dot } from './geometry';

export type MeasureKind = 'length' | 'angle' | 'area';

function between(a: Vec3, b: Vec3): Vec3 {
  return [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
}

// At the second of three points, in degrees.
export function angleAt(a: Vec3, middle: Vec3, b: Vec3): number {
  const [u, v] = [between(middle, a), between(middle, b)];
  return (Math.atan2(Math.hypot(...cross(u, v)), dot(u, v)) * 180) / Math.PI;
}

// Of a polygon in a plane.
export function areaOf(points: readonly Vec3[]): number {
  const [origin] = points;
  if (!origin) return 0;
  const sum: Vec3 = [0, 0, 0];
  for (let i = 1; i + 1 < points.length; i += 1) {
    const part = cross(between(origin, points[i] as Vec3), between(origin, points[i + 1] as Vec3));
    for (const axis of [0, 1, 2] as const) sum[axis] += part[axis];
  }
  return Math.hypot(...sum) / 2;
}

// So many points make it whole; an area has as many as a person likes.
export const pointsOf: Record<MeasureKind, number> = { length: 2, angle: 3, area: Infinity };

// '' while points are missing.
export function measureText(kind: MeasureKind, points: readonly Vec3[]): string {
  const [a, b, c] = points;
  if (kind === 'length') return a && b ? `${formatSize(Math.hypot(...between(a, b)))} mm` : '';
  if (!a || !b || !c) return '';
  return kind === 'angle' ? `${formatNumber(angleAt(a, b, c), 1)}\u00b0` : `${formatSize(areaOf(points))} mm\u00b2`;
}
