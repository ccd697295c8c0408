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
    this.show([]);
  }

  show(places: readonly Vec3[]): void {
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(places.flat()), 3));
    this.geometry.setDrawRange(0, places.length);
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }
}
