// What surfaces are drawn with.
import { BackSide, DoubleSide, FrontSide, MeshPhongMaterial } from 'three';

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
