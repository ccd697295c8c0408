import { load } from '@loaders.gl/core';
import draco3d from 'draco3d';
import { DracoLoader } from '@loaders.gl/draco';
import { GLTFLoader, postProcessGLTF } from '@loaders.gl/gltf';
import { OBJLoader } from '@loaders.gl/obj';
import { bytesOf, hexOfLinear, identity, main, surface } from './report.mjs';

// The matrix of translation, rotation and scale that a node has, in front of its parent's.
function product(a, b) {
  return Array.from({ length: 16 }, (_, at) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (at % 4)] * b[4 * Math.floor(at / 4) + k], 0));
}

function matrixOf({ matrix, translation = [0, 0, 0], rotation: [x, y, z, w] = [0, 0, 0, 1], scale: [sx, sy, sz] = [1, 1, 1] }) {
  if (matrix) return matrix;
  return [
    ...[(1 - 2 * (y * y + z * z)) * sx, 2 * (x * y + z * w) * sx, 2 * (x * z - y * w) * sx, 0],
    ...[2 * (x * y - z * w) * sy, (1 - 2 * (x * x + z * z)) * sy, 2 * (y * z + x * w) * sy, 0],
    ...[2 * (x * z + y * w) * sz, 2 * (y * z - x * w) * sz, (1 - 2 * (x * x + y * y)) * sz, 0],
    ...[...translation, 1],
  ];
}

function* surfacesOf(node, parent) {
  const matrix = product(parent, matrixOf(node));
  for (const { attributes, indices, material } of node.mesh?.primitives ?? []) {
    const { POSITION, NORMAL, ...others } = attributes;
    const more = {
      name: node.name,
      colour: hexOfLinear(material.pbrMetallicRoughness.baseColorFactor),
      normals: NORMAL !== undefined,
      values: Object.keys(others),
    };
    // Quantized positions stay integers; whoever draws them normalizes them, if the accessor says so.
    const limit = { 5120: 127, 5122: 32767, 5121: 255, 5123: 65535 }[POSITION.componentType];
    const points = POSITION.normalized ? Float64Array.from(POSITION.value, (v) => v / limit) : POSITION.value;
    yield surface(points, (indices.value ?? indices).length / 3, more, matrix);
  }
  for (const child of node.children ?? []) yield* surfacesOf(child, matrix);
}

await main('@loaders.gl/core', async (path, suffix) => {
  const loader = { glb: GLTFLoader, drc: DracoLoader, obj: OBJLoader }[suffix];
  const read = await load(bytesOf(path).buffer, loader, { worker: false, core: { worker: false }, modules: { draco3d } });
  if (suffix === 'glb') return postProcessGLTF(read).scene.nodes.flatMap((node) => [...surfacesOf(node, identity)]);
  const { attributes, indices } = read;
  const points = attributes.POSITION.value;
  return [surface(points, (indices?.value.length ?? points.length / 3) / 3, { normals: 'NORMAL' in attributes })];
});
