// The plane that cuts the surface along one of the volume's axes or at any angle, with the slice that lies there.
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
import type { Axis, Vec3, Volume } from '../api/types';
import { axisDirection, axisIndex, cross, dot, pictureAxes, toPatient } from '../volume/geometry';
import { sectionOf } from '../volume/oblique';
import type { Square } from '../volume/reslice';

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
    this.quad.visible = false;
    this.quad.frustumCulled = false;
    parent.add(this.quad);
  }

  place(volume: Volume, { axis, index, flipped }: CutPlace): void {
    const across = axisIndex(axis);
    const [first, second] = pictureAxes(axis);
    const corners = [
      [0, 0],
      [1, 0],
      [1, 1],
      [0, 1],
    ] as const;
    const places = corners.map(([u, v]) => {
      const at: Vec3 = [0, 0, 0];
      at[across] = index;
      // A picture's element covers half a sample to each side.
      at[first] = u * volume.dims[first] - 0.5;
      at[second] = v * volume.dims[second] - 0.5;
      return toPatient(volume, at);
    });
    // Across the slice, which in a tilted volume is not where its third axis points.
    const along = axisDirection(volume, across);
    const normal = cross(axisDirection(volume, first), axisDirection(volume, second));
    this.set(normal, dot(normal, along) > 0 !== flipped, places, corners);
  }

  // At any angle: the plane n . p = depth, and a picture of a square in it; what is seen is what it cuts out of the volume.
  placeFreely(volume: Volume, normal: Vec3, depth: number, { middle, right, down, size }: Square): void {
    const cornerAt = (bits: number): Vec3 =>
      toPatient(volume, volume.dims.map((count, axis) => (((bits >> axis) & 1) === 0 ? -0.5 : count - 0.5)) as Vec3);
    const places = sectionOf(cornerAt, normal, depth);
    const uvs = places.map((place) => {
      const from = place.map((value, axis) => value - middle[axis as 0]) as Vec3;
      return [dot(from, right) / size + 0.5, dot(from, down) / size + 0.5] as const;
    });
    this.set(normal, false, places, uvs);
    // It may pass by the volume.
    this.plane.set(new Vector3(...normal), -depth);
  }

  private set(normal: Vec3, isTurned: boolean, places: readonly Vec3[], uvs: readonly (readonly [number, number])[]): void {
    const { geometry, plane } = this;
    geometry.setAttribute('position', new BufferAttribute(Float32Array.from(places.flat()), 3));
    geometry.setAttribute('uv', new BufferAttribute(Float32Array.from(uvs.flat()), 2));
    geometry.setIndex(places.slice(2).flatMap((_, at) => [0, at + 1, at + 2]));
    geometry.computeBoundingSphere();
    const away = new Vector3(...normal).normalize();
    if (isTurned) away.negate();
    plane.setFromNormalAndCoplanarPoint(away, new Vector3(...(places[0] ?? [0, 0, 0])));
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
