#!/bin/sh
# Guess: a scene of Babylon.js with useRightHandedSystem shows a tetrahedron of an STL file where it shows the same one of an OBJ or glTF
#   file: STL, OBJ and glTF are all right-handed, so nothing needs to be converted.
# Seen: the OBJ and the glTF lie where their coordinates say. The STL has y and z exchanged, in both kinds of scene. In a right-handed one
#   that is a mirror image: a left hand becomes a right hand. STLFileLoader.DO_NOT_ALTER_FILE_COORDINATES = true leaves the coordinates.
# Packages: npm @babylonjs/core and @babylonjs/loaders 9.28.0. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @babylonjs/core@9.28.0 @babylonjs/loaders@9.28.0 >npm.log 2>&1
cat >read.mjs <<'M'
import { NullEngine } from '@babylonjs/core/Engines/nullEngine.js';
import { Scene } from '@babylonjs/core/scene.js';
import { LoadAssetContainerAsync } from '@babylonjs/core/Loading/sceneLoader.js';
import '@babylonjs/core/Materials/standardMaterial.js';
import '@babylonjs/loaders/glTF/index.js';
import '@babylonjs/loaders/OBJ/index.js';
import '@babylonjs/loaders/STL/index.js';
// A tetrahedron from (1, 2, 3) to (2, 4, 6).
const points = [[1, 2, 3], [2, 2, 3], [1, 4, 3], [1, 2, 6]];
const faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
const obj = [...points.map((p) => `v ${p.join(' ')}`), ...faces.map((f) => `f ${f.map((v) => v + 1).join(' ')}`)].join('\n');
const facet = (f) => `facet normal 0 0 0\nouter loop\n${f.map((v) => `vertex ${points[v].join(' ')}`).join('\n')}\nendloop\nendfacet`;
const stl = `solid a\n${faces.map(facet).join('\n')}\nendsolid a\n`;
const bytes = Buffer.concat([Buffer.from(new Float32Array(points.flat()).buffer), Buffer.from(new Uint16Array(faces.flat()).buffer)]);
const gltf = JSON.stringify({
  asset: { version: '2.0' }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }],
  meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
  accessors: [{ bufferView: 0, componentType: 5126, count: 4, type: 'VEC3', min: [1, 2, 3], max: [2, 4, 6] },
    { bufferView: 1, componentType: 5123, count: 12, type: 'SCALAR' }],
  bufferViews: [{ buffer: 0, byteLength: 48 }, { buffer: 0, byteOffset: 48, byteLength: 24 }],
  buffers: [{ byteLength: 72, uri: `data:application/octet-stream;base64,${bytes.toString('base64')}` }],
});
for (const isRightHanded of [false, true]) {
  const scene = new Scene(new NullEngine());
  scene.useRightHandedSystem = isRightHanded;
  for (const [suffix, text] of [['gltf', gltf], ['obj', obj], ['stl', stl]]) {
    const { meshes } = await LoadAssetContainerAsync(`data:${text}`, scene, { pluginExtension: `.${suffix}` });
    const mesh = meshes.find((one) => one.getTotalVertices() > 0);
    mesh.computeWorldMatrix(true);
    mesh.refreshBoundingInfo();
    const { minimumWorld, maximumWorld } = mesh.getBoundingInfo().boundingBox;
    const [from, to] = [minimumWorld, maximumWorld].map(({ x, y, z }) => [x, y, z].map(Math.round).join(' '));
    console.log(`${isRightHanded ? 'right' : 'left'}-handed, ${suffix}: ${from} to ${to}`);
  }
}
process.exit(0);
M
seen=$(node read.mjs | grep handed)
echo "$seen"
want='left-handed, gltf: -2 2 3 to -1 4 6
left-handed, obj: -2 2 3 to -1 4 6
left-handed, stl: 1 3 2 to 2 6 4
right-handed, gltf: 1 2 3 to 2 4 6
right-handed, obj: 1 2 3 to 2 4 6
right-handed, stl: 1 3 2 to 2 6 4'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
