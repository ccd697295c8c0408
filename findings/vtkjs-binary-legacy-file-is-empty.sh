#!/bin/sh
# Guess: vtk.js reads legacy files (.vtk) as VTK writes them, as text and in binary; or it says that it does not read one of the kinds.
# Seen: its vtkPolyDataReader makes an empty surface of a binary file: 0 points, 0 polygons, no error, no warning. The same surface as
#   text has its 4 points and 4 polygons.
# Packages: npm @kitware/vtk.js 37.4.3. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @kitware/vtk.js@37.4.3 >npm.log 2>&1
cat >read.mjs <<'M'
import reader from '@kitware/vtk.js/IO/Legacy/PolyDataReader.js';

let said = 0;
for (const name of ['log', 'warn', 'error']) globalThis.console[name] = () => (said += 1);

// A tetrahedron.
const points = [0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4];
const polygons = [3, 0, 2, 1, 3, 0, 1, 3, 3, 0, 3, 2, 3, 1, 2, 3];
function legacy(kind, numbers) {
  const head = `# vtk DataFile Version 3.0\na tetrahedron\n${kind}\nDATASET POLYDATA\nPOINTS 4 float\n`;
  const [first, second] = numbers;
  return Buffer.concat([head, first, '\nPOLYGONS 4 16\n', second, '\n'].map((part) => Buffer.from(part)));
}
function bigEndian(values, write) {
  const bytes = Buffer.alloc(4 * values.length);
  values.forEach((value, at) => bytes[write](value, 4 * at));
  return bytes;
}
const files = {
  text: legacy('ASCII', [points.join(' '), polygons.join(' ')]),
  binary: legacy('BINARY', [bigEndian(points, 'writeFloatBE'), bigEndian(polygons, 'writeInt32BE')]),
};
for (const [kind, bytes] of Object.entries(files)) {
  const legacyReader = reader.newInstance();
  legacyReader.parseAsText(bytes.toString('latin1'));
  const surface = legacyReader.getOutputData();
  const found = `${surface.getNumberOfPoints()} points, ${surface.getNumberOfPolys()} polygons`;
  process.stdout.write(`${kind}: ${found}, ${said} messages\n`);
}
M
seen=$(node read.mjs 2>&1)
echo "$seen"
want='text: 4 points, 4 polygons, 0 messages
binary: 0 points, 0 polygons, 0 messages'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
