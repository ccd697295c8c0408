#!/bin/sh
# Guess: the same tetrahedron has 4 triangles in Mol*, whichever encoding of the VTP format holds it: text, raw bytes or base64, as VTK and
#   ParaView write them.
# Seen: text is right. Of uncompressed base64, Mol* reads each array some bytes off: it says 786426 triangles, and the coordinates are
#   about 1e-41, without an error. It decodes the array's size and its data as two pieces of base64. VTK encodes both as one.
# Packages: npm molstar 5.11.0. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save molstar@5.11.0 >npm.log 2>&1
cat >read.mjs <<'M'
import { parseVtp } from 'molstar/lib/mol-io/reader/vtp/parser.js';
const points = new Float32Array([1, 2, 3, 2, 2, 3, 1, 4, 3, 1, 2, 6]);
const corners = new Int32Array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
const ends = new Int32Array([3, 6, 9, 12]);
const encodings = {
  text: (array) => `format="ascii">${array.join(' ')}`,
  base64: (array) => {
    const size = Buffer.alloc(4);
    size.writeUInt32LE(array.byteLength);
    return `format="binary">${Buffer.concat([size, Buffer.from(array.buffer)]).toString('base64')}`;
  },
};
for (const [name, encode] of Object.entries(encodings)) {
  const data = (type, of, array) => `<DataArray type="${type}" Name="${of}" NumberOfComponents="${of === 'Points' ? 3 : 1}" ${encode(array)}</DataArray>`;
  const file = `<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt32"><PolyData>
<Piece NumberOfPoints="4" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="4">
<Points>${data('Float32', 'Points', points)}</Points>
<Polys>${data('Int32', 'connectivity', corners)}${data('Int32', 'offsets', ends)}</Polys>
</Piece></PolyData></VTKFile>`;
  const { isError, message, result } = await parseVtp(Buffer.from(file)).run();
  const first = isError ? '' : [...result.positions.slice(0, 3)].map((value) => Number(value.toPrecision(2))).join(' ');
  console.log(`${name}: ${isError ? message : `${result.numberOfTriangles} triangles, the first point is ${first}`}`);
}
M
seen=$(node read.mjs 2>/dev/null | grep :)
echo "$seen"
[ "$seen" = 'text: 4 triangles, the first point is 1 2 3
base64: 786426 triangles, the first point is 2.3e-41 2.3e-41 2.3e-41' ] || { echo changed; exit 1; }
