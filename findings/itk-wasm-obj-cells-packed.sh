#!/bin/sh
# Guess: `mesh.cells` has the same layout whichever file it was read from: type, number of points, their indices, one number each. The
#   same tetrahedron as OBJ and as OFF gives the same 20 numbers.
# Seen: the OFF does. The OBJ gives 20 BigInts (cellComponentType says int64): each of the first 10 is made of two of the numbers, lower
#   half first, and the other 10 are 0. A program that follows the layout finds no triangle, and no error. As 32-bit numbers, the bytes are right.
# Packages: npm @itk-wasm/mesh-io 1.7.1. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @itk-wasm/mesh-io@1.7.1 >npm.log 2>&1
cat >a.obj <<'F'
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
F
cat >a.off <<'F'
OFF
4 4 0
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
F
cat >read.mjs <<'M'
import { readMeshNode } from '@itk-wasm/mesh-io';
for (const file of ['a.off', 'a.obj']) {
  const { cells, cellBufferSize, meshType } = await readMeshNode(file);
  const numbers = new Uint32Array(cells.buffer, cells.byteOffset, cells.byteLength / 4);
  let triangles = 0;
  for (let at = 0; at < cells.length; at += 2 + Number(cells[at + 1])) triangles += Number(cells[at + 1]) === 3 ? 1 : 0;
  console.log(`${file}: ${meshType.cellComponentType}, ${cells.length} of ${cellBufferSize} numbers, ${triangles} triangles`);
  console.log(`  as 32-bit numbers: ${[...numbers.slice(0, 20)].join(' ')}`);
}
process.exit(0);
M
seen=$(node read.mjs)
echo "$seen"
want='a.off: uint32, 20 of 20 numbers, 4 triangles
  as 32-bit numbers: 2 3 0 2 1 2 3 0 1 3 2 3 0 3 2 2 3 1 2 3
a.obj: int64, 20 of 20 numbers, 0 triangles
  as 32-bit numbers: 4 3 0 2 1 4 3 0 1 3 4 3 0 3 2 4 3 1 2 3'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
