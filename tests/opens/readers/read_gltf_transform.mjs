import { NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS } from '@gltf-transform/extensions';
import draco3d from 'draco3d';
import { MeshoptDecoder } from 'meshoptimizer';
import { hexOfLinear, main, surface } from './report.mjs';

const names = ['POSITION', 'NORMAL'];

await main('@gltf-transform/core', async (path) => {
  const decoders = { 'draco3d.decoder': await draco3d.createDecoderModule(), 'meshopt.decoder': MeshoptDecoder };
  const document = await new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies(decoders).read(path);
  const surfaces = [];
  document.getRoot().getDefaultScene().traverse((node) => {
    for (const primitive of node.getMesh()?.listPrimitives() ?? []) {
      const position = primitive.getAttribute('POSITION');
      const points = [];
      for (let at = 0; at < position.getCount(); at += 1) points.push(...position.getElement(at, []));
      const more = {
        name: node.getName(),
        colour: hexOfLinear(primitive.getMaterial().getBaseColorFactor()),
        normals: primitive.getAttribute('NORMAL') !== null,
        values: primitive.listSemantics().filter((name) => !names.includes(name)),
      };
      surfaces.push(surface(points, primitive.getIndices().getCount() / 3, more, node.getWorldMatrix()));
    }
  });
  return surfaces;
});
