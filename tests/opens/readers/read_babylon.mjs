import './dom.mjs';
import { NullEngine } from '@babylonjs/core/Engines/nullEngine.js';
import { Scene } from '@babylonjs/core/scene.js';
import { LoadAssetContainerAsync } from '@babylonjs/core/Loading/sceneLoader.js';
import { DracoDecoder } from '@babylonjs/core/Meshes/Compression/dracoDecoder.js';
import { MeshoptCompression } from '@babylonjs/core/Meshes/Compression/meshoptCompression.js';
import '@babylonjs/core/Materials/standardMaterial.js';
import '@babylonjs/loaders/glTF/index.js';
import '@babylonjs/loaders/OBJ/index.js';
import '@babylonjs/loaders/STL/index.js';
import draco3d from 'draco3d';
import { MeshoptDecoder } from 'meshoptimizer';
import { pathToFileURL } from 'node:url';
import { bytesOfModule, hex, hexOfLinear, main, surface } from './report.mjs';

function colourOf(material) {
  const { albedoColor: linear, diffuseColor: encoded } = material ?? {};
  if (linear) return hexOfLinear([linear.r, linear.g, linear.b]);
  return encoded && hex([encoded.r, encoded.g, encoded.b]);
}

await main('@babylonjs/core', async (path) => {
  const wasmBinary = bytesOfModule('draco3d/draco_decoder.wasm').buffer;
  Object.assign(DracoDecoder.DefaultConfiguration, { jsModule: draco3d.createDecoderModule, wasmBinary, numWorkers: 0 });
  MeshoptCompression._Default = {
    decodeGltfBufferAsync: async (source, count, stride, mode, filter) => {
      await MeshoptDecoder.ready;
      const target = new Uint8Array(count * stride);
      MeshoptDecoder.decodeGltfBuffer(target, count, stride, source, mode, filter);
      return target;
    },
  };
  const scene = new Scene(new NullEngine());
  scene.useRightHandedSystem = true;
  const container = await LoadAssetContainerAsync(pathToFileURL(path).href, scene);
  return container.meshes
    .filter((mesh) => mesh.getTotalVertices() > 0)
    .map((mesh) => {
      const more = {
        name: /^(.*)_primitive\d+$/.exec(mesh.name)?.[1] ?? mesh.name,
        colour: colourOf(mesh.material) ?? null,
        normals: mesh.isVerticesDataPresent('normal'),
        values: mesh.getVerticesDataKinds().filter((kind) => !['position', 'normal'].includes(kind)),
      };
      return surface(mesh.getVerticesData('position'), mesh.getTotalIndices() / 3, more, mesh.computeWorldMatrix(true).m);
    });
});
