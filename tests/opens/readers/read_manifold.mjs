import { gltfDocToManifold, readModel } from 'manifold-3d/lib/import-model.js';
import { getMaterialByID } from 'manifold-3d/lib/material.js';
import { getManifoldModule } from 'manifold-3d/lib/wasm.js';
import { hexOfLinear, main } from './report.mjs';

// The surfaces of each node by themselves: Manifold makes one solid of all that it is given.
await main('manifold-3d', async (path) => {
  await getManifoldModule();
  const document = await readModel(path);
  const surfaces = [];
  document.getRoot().getDefaultScene().traverse((node) => {
    if (!node.getMesh()) return;
    const solid = gltfDocToManifold(document, node);
    const { min, max } = solid.boundingBox();
    const [material] = solid.getMesh().runOriginalID;
    surfaces.push({
      name: node.getName(),
      colour: hexOfLinear(getMaterialByID(material).baseColorFactor),
      triangles: solid.numTri(),
      vertices: solid.numVert(),
      bounds: [min, max],
    });
  });
  return surfaces;
});
