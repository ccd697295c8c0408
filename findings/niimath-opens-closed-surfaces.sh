#!/bin/sh
# Guess: `niimath -mesh -r 0.1` thins out a surface and keeps what matters: the closed surfaces of a hollow ball stay closed. The same ball
#   stored with a mirrored first axis, at the same place, has the same mesh.
# Seen: without reduction all edges have two triangles, in both files. With `-p 0 -r 0.1`, 4 edges have another number of triangles, and 3 in the
#   mirrored file. There is no warning, and the two meshes differ in their volume. A printer's or a solver's check then rejects the file.
# Packages: npm @niivue/niimath 1.0.1. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @niivue/niimath@1.0.1 >npm.log 2>&1
cat >mesh.mjs <<'M'
import fs from 'node:fs';
import zlib from 'node:zlib';
import niimath from './node_modules/@niivue/niimath/dist/niimath.js';

const size = 40;
// A hollow ball, its samples at the same places whether the first axis runs to the right or to the left.
function nifti(mirrored) {
  const bytes = Buffer.alloc(352 + size ** 3);
  bytes.writeInt32LE(348, 0);
  [3, size, size, size, 1, 1, 1, 1].forEach((value, at) => bytes.writeInt16LE(value, 40 + 2 * at));
  bytes.writeInt16LE(2, 70);
  bytes.writeInt16LE(8, 72);
  for (const at of [76, 80, 84, 88, 112]) bytes.writeFloatLE(1, at);
  bytes.writeFloatLE(352, 108);
  bytes.writeInt16LE(1, 254);
  const rows = mirrored ? [-1, 0, 0, size - 1] : [1, 0, 0, 0];
  [...rows, 0, 1, 0, 0, 0, 0, 1, 0].forEach((value, at) => bytes.writeFloatLE(value, 280 + 4 * at));
  bytes.write('n+1\0', 344);
  for (let z = 0; z < size; z++) for (let y = 0; y < size; y++) for (let i = 0; i < size; i++) {
    const square = ((mirrored ? size - 1 - i : i) - 20) ** 2 + (y - 18) ** 2 + (z - 21) ** 2;
    bytes[352 + (z * size + y) * size + i] = square > 81 && square < 144 ? 100 : 0;
  }
  return bytes;
}

for (const mirrored of [false, true]) for (const kept of ['1', '0.1']) {
  const program = await niimath({ wasmBinary: fs.readFileSync('node_modules/@niivue/niimath/dist/niimath.wasm'), print() {}, printErr() {} });
  program.FS_createDataFile('.', 'in.nii', new Uint8Array(nifti(mirrored)), true, true);
  program.callMain(['in.nii', '-mesh', '-i', '50', '-b', '0', '-l', '0', '-s', '0', '-p', '0', '-r', kept, 'out.mz3']);
  let mesh = Buffer.from(program.FS_readFile('out.mz3'));
  if (mesh[0] === 0x1f) mesh = zlib.gunzipSync(mesh);
  const corners = Array.from({ length: 3 * mesh.readUInt32LE(4) }, (_, at) => mesh.readUInt32LE(16 + mesh.readUInt32LE(12) + 4 * at));
  const edges = new Map();
  corners.forEach((corner, at) => {
    const edge = [corner, corners[at % 3 === 2 ? at - 2 : at + 1]].sort().join();
    edges.set(edge, (edges.get(edge) ?? 0) + 1);
  });
  console.log(`${mirrored ? 'mirrored' : 'plain'}, ${kept} kept: ${[...edges.values()].filter((count) => count !== 2).length} open or crowded edges`);
}
M
seen=$(node mesh.mjs | paste -sd'|')
echo "$seen" | tr '|' '\n'
[ "$seen" = 'plain, 1 kept: 0 open or crowded edges|plain, 0.1 kept: 4 open or crowded edges|mirrored, 1 kept: 0 open or crowded edges|mirrored, 0.1 kept: 3 open or crowded edges' ] ||
  { echo changed; exit 1; }
