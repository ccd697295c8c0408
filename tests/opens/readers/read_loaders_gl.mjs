import { load } from '@loaders.gl/core';
import draco3d from 'draco3d';
import { DracoLoader } from '@loaders.gl/draco';
import { GLTFLoader, postProcessGLTF } from '@loaders.gl/gltf';
import { OBJLoader } from '@loaders.gl/obj';
import { Matrix4, Quaternion, Vector3 } from 'three';
import { bytesOf, hexOfLinear, main, surface } from './report.mjs';

function matrixOf({ matrix, translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] }) {
  if (matrix) return new Matrix4().fromArray(matrix);
  return new Matrix4().compose(new Vector3(...translation), new Quaternion(...rotation), new Vector3(...scale));
}

function* surfacesOf(node, parent) {
  const matrix = parent.clone().multiply(matrixOf(node));
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
    yield surface(points, (indices.value ?? indices).length / 3, more, matrix.elements);
  }
  for (const child of node.children ?? []) yield* surfacesOf(child, matrix);
}

await main('@loaders.gl/core', async (path, suffix) => {
  const loader = { glb: GLTFLoader, drc: DracoLoader, obj: OBJLoader }[suffix];
  const read = await load(bytesOf(path).buffer, loader, { core: { worker: false }, modules: { draco3d } });
  if (suffix === 'glb') return postProcessGLTF(read).scene.nodes.flatMap((node) => [...surfacesOf(node, new Matrix4())]);
  const { attributes, indices } = read;
  const points = attributes.POSITION.value;
  return [surface(points, (indices?.value.length ?? points.length / 3) / 3, { normals: 'NORMAL' in attributes })];
});
