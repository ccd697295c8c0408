// The plane that cuts the surface along one of the volume's axes, with the slice that lies there.
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  LinearFilter,
  Mesh,
  MeshBasicMaterial,
  Plane,
  SRGBColorSpace,
  Texture,
  Vector3,
  type Intersection,
  type Object3D,
  type Raycaster,
} from 'three';
import type { Axis, Volume } from '../api/types';
import { axisDirection, axisIndex, pictureAxes, toPatient } from '../volume/geometry';

export interface CutPlace {
  axis: Axis;
  index: number;
  // Which side of the plane stays.
  flipped: boolean;
}

export class Cut {
  readonly plane = new Plane();
  private readonly geometry = new BufferGeometry();
  private readonly texture = new Texture();
  private readonly material = new MeshBasicMaterial({ side: DoubleSide, toneMapped: false });
  private readonly quad = new Mesh(this.geometry, this.material);

  constructor(parent: Object3D) {
    this.texture.colorSpace = SRGBColorSpace;
    this.texture.minFilter = LinearFilter;
    this.texture.generateMipmaps = false;
    this.texture.flipY = false;
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(12), 3));
    this.geometry.setAttribute('uv', new BufferAttribute(new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]), 2));
    this.geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.quad.visible = false;
    this.quad.frustumCulled = false;
    parent.add(this.quad);
  }

  place(volume: Volume, { axis, index, flipped }: CutPlace): void {
    const across = axisIndex(axis);
    const [first, second] = pictureAxes(axis);
    const positions = this.geometry.getAttribute('position') as BufferAttribute;
    const corners = [
      [0, 0],
      [1, 0],
      [1, 1],
      [0, 1],
    ] as const;
    corners.forEach(([u, v], corner) => {
      const at: [number, number, number] = [0, 0, 0];
      at[across] = index;
      // A picture's element covers half a sample to each side.
      at[first] = u * volume.dims[first] - 0.5;
      at[second] = v * volume.dims[second] - 0.5;
      positions.setXYZ(corner, ...toPatient(volume, at));
    });
    positions.needsUpdate = true;
    this.geometry.computeBoundingSphere();
    // Across the slice, which in a tilted volume is not where its third axis points.
    const along = new Vector3(...axisDirection(volume, across));
    const normal = new Vector3(...axisDirection(volume, first))
      .cross(new Vector3(...axisDirection(volume, second)))
      .normalize();
    if (normal.dot(along) > 0 !== flipped) normal.negate();
    this.plane.setFromNormalAndCoplanarPoint(
      normal,
      new Vector3().fromBufferAttribute(positions, 0),
    );
  }

  // Takes the picture over; null shows no slice.
  show(picture: ImageBitmap | null): void {
    (this.texture.image as ImageBitmap | null)?.close();
    this.texture.dispose();
    this.texture.image = picture;
    this.texture.needsUpdate = picture !== null;
    this.material.map = picture ? this.texture : null;
    this.material.needsUpdate = true;
    this.quad.visible = picture !== null;
  }

  // Where the ray meets the slice that is shown.
  hit(ray: Raycaster): Intersection | null {
    return this.quad.visible ? (ray.intersectObject(this.quad)[0] ?? null) : null;
  }

  dispose(): void {
    this.show(null);
    this.geometry.dispose();
    this.material.dispose();
  }
}
