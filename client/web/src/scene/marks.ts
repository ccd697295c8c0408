// Points that are seen through the surface.
import { BufferAttribute, BufferGeometry, Points, PointsMaterial, type Object3D } from 'three';
import type { Vec3 } from '../api/types';
import { overLayer } from './cross';

export class Marks {
  private readonly geometry = new BufferGeometry();
  private readonly material = new PointsMaterial({ color: '#e5484d', size: 9, sizeAttenuation: false, depthTest: false, transparent: true });

  constructor(parent: Object3D) {
    const points = new Points(this.geometry, this.material);
    points.frustumCulled = false;
    points.renderOrder = 12;
    points.layers.set(overLayer);
    parent.add(points);
    this.geometry.setDrawRange(0, 0);
  }

  // Returns the way from the middle of the bounds to the first of them; null where there is none.
  show(places: readonly Vec3[], [low, high]: [Vec3, Vec3]): Vec3 | null {
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(places.flat()), 3));
    this.geometry.setDrawRange(0, places.length);
    const [first] = places;
    const way = first?.map((value, axis) => value - (low[axis as 0] + high[axis as 0]) / 2) as Vec3 | undefined;
    return way && Math.hypot(...way) > 0 ? way : null;
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }
}
