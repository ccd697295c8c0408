// How a surface is drawn, and what is measured on it, without what draws it.
import type { Vec3 } from '../api/types';

export interface SurfaceStyle {
  shading: 'smooth' | 'flat';
  wireframe: boolean;
  opacity: number;
  // Colours tell the vertices' distances, where the file has them.
  distance: boolean;
}

export const defaultStyle: SurfaceStyle = { shading: 'smooth', wireframe: false, opacity: 1, distance: false };

export interface Ruler {
  from: Vec3;
  to: Vec3;
}

export function lengthOf({ from, to }: Ruler): number {
  return Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
}
