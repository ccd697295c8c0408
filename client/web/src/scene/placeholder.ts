// Stands for a block until the first one is there.
import { BufferAttribute, BufferGeometry } from 'three';

// A geometry without triangles, but with a block's attributes: three.js makes other shaders for a geometry without normals, so
// those that are made for the placeholder would not be those that blocks are drawn with.
export function placeholder(): BufferGeometry {
  const made = new BufferGeometry();
  made.setAttribute('position', new BufferAttribute(new Float32Array(), 3));
  made.setAttribute('normal', new BufferAttribute(new Int16Array(), 4, true));
  return made;
}
