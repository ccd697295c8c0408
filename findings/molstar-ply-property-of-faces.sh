#!/bin/sh
# Guess: a PLY file may give each face a number beside the list of its vertices, such as a label. The header tells its type, so a reader
#   that does not need it skips it, before and behind the list.
# Seen: Mol* takes the first property of faces for the list, and expects no other. Before the list, the number makes faces without
#   vertices: the file loads, and nothing is shown. Behind the list, its bytes are read as the next list: of four faces one is left. A
#   larger file ends with a RangeError.
# Packages: npm molstar 5.11.0. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save molstar@5.11.0 >npm.log 2>&1
cat >read.mjs <<'M'
import { parsePly } from 'molstar/lib/mol-io/reader/ply/parser.js';
import { shapeFromPly } from 'molstar/lib/mol-model-formats/shape/ply.js';

// A tetrahedron. `before` and `behind` are numbers of each face.
function ply({ before = [], behind = [] }) {
  const numbers = (values) => values.map((name) => `property int ${name}\n`).join('');
  const head =
    'ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n' +
    `element face 4\n${numbers(before)}property list uchar uint vertex_indices\n${numbers(behind)}end_header\n`;
  const int = (value) => Buffer.from(Int32Array.of(value).buffer);
  const parts = [Buffer.from(head), Buffer.from(Float32Array.of(0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4).buffer)];
  for (const corners of [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]) {
    parts.push(...before.map(() => int(7)), Buffer.of(3), ...corners.map(int), ...behind.map(() => int(7)));
  }
  return new Uint8Array(Buffer.concat(parts));
}

for (const form of [{}, { before: ['label'] }, { behind: ['label'] }]) {
  let found;
  try {
    const { result } = await parsePly(ply(form)).run();
    const provider = await shapeFromPly(result).run();
    const defaults = Object.entries(provider.params).map(([name, value]) => [name, value.defaultValue]);
    const shape = await provider.getShape({}, provider.data, Object.fromEntries(defaults));
    found = `${result.getElement('face').rowCount} faces, ${shape.geometry.triangleCount} triangles`;
  } catch (error) {
    found = error.name;
  }
  console.log(`label ${Object.keys(form)[0] ?? 'absent'}: ${found}`);
}
M
seen=$(node read.mjs 2>&1)
echo "$seen"
want='label absent: 4 faces, 4 triangles
label before: 4 faces, 0 triangles
label behind: 4 faces, 1 triangles'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
