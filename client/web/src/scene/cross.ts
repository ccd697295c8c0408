// Lines through a sample along the volume's axes, over the surface.
import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments, type Object3D } from 'three';
import type { Vec3, Volume } from '../api/types';
import { toPatient } from '../volume/geometry';

// The layer of things over the surface, so that they are drawn once.
export const overLayer = 1;

export class Cross {
  private readonly geometry = new BufferGeometry();
  private readonly material = new LineBasicMaterial({ color: '#17a398', transparent: true, opacity: 0.55, depthTest: false });
  private readonly lines = new LineSegments(this.geometry, this.material);

  constructor(parent: Object3D) {
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(18), 3));
    this.lines.visible = false;
    this.lines.frustumCulled = false;
    this.lines.renderOrder = 9;
    this.lines.layers.set(overLayer);
    parent.add(this.lines);
  }

  place(volume: Volume, cursor: Vec3 | null): void {
    this.lines.visible = cursor !== null;
    if (!cursor) return;
    const positions = this.geometry.getAttribute('position');
    for (const axis of [0, 1, 2] as const) {
      for (const end of [0, 1] as const) {
        const sample: Vec3 = [...cursor];
        sample[axis] = end * (volume.dims[axis] - 1);
        positions.setXYZ(2 * axis + end, ...toPatient(volume, sample));
      }
    }
    positions.needsUpdate = true;
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }
}
