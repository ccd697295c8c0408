// Materials and geometries that surfaces are drawn with.
import { BackSide, BufferAttribute, BufferGeometry, DoubleSide, FrontSide, MeshPhongMaterial } from 'three';
import type { Coarse } from '../mesh/coarse';

export const neutral = '#dcd6c8';

export function material(colour: string): MeshPhongMaterial {
  return new MeshPhongMaterial({ color: colour, specular: 0x1c1c1c, shininess: 24, side: DoubleSide, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
}

// The wall that two labels share is there for each of them, and seen from inside of one it is the other's
// front. Backs lie a little farther away, so that the two do not fight for the same depth.
export function labelMaterials(colour: string): MeshPhongMaterial[] {
  const front = material(colour);
  const back = material(colour);
  front.side = FrontSide;
  back.side = BackSide;
  back.polygonOffsetFactor = 2;
  back.polygonOffsetUnits = 2;
  return [front, back];
}

export function geometryOf({ positions, normals, distances }: Omit<Coarse, 'index'>, index: Uint16Array | Uint32Array): BufferGeometry {
  const made = new BufferGeometry();
  made.setAttribute('position', new BufferAttribute(positions, 3));
  made.setAttribute('normal', new BufferAttribute(normals, 4, true));
  if (distances) made.setAttribute('distanceMm', new BufferAttribute(distances, 1));
  made.setIndex(new BufferAttribute(index, 1));
  return made;
}
