#!/bin/sh
# Guess: the geometry loader of cornerstone3D rejects a mesh that the server does not have.
# Seen: it never looks at the HTTP status. It parses the JSON of a 404 as the mesh: for PLY and OBJ, the promise resolves with an empty
#   surface of 0 points. For STL and VTP it rejects with errors of the parsers, which do not say that the server answered 404.
# Packages: npm @cornerstonejs/core 5.14.0, xhr2 0.2.1 (XMLHttpRequest for Node). Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @cornerstonejs/core@5.14.0 xhr2@0.2.1 >npm.log 2>&1
cat >load.mjs <<'M'
import { createServer } from 'node:http';
import { Enums, geometryLoader } from '@cornerstonejs/core';
import xhr from 'xhr2';

globalThis.XMLHttpRequest = xhr.XMLHttpRequest;
const problem = JSON.stringify({ title: 'Not found', status: 404, detail: 'There is no such mesh.' });
const server = createServer((_, response) => {
  response.writeHead(404, { 'Content-Type': 'application/problem+json' }).end(problem);
});
await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
for (const format of ['PLY', 'OBJ', 'STL', 'VTP']) {
  const id = `mesh:http://127.0.0.1:${server.address().port}/mesh.${format}`;
  const options = { type: Enums.GeometryType.MESH, geometryData: { id: format, format } };
  try {
    const { data } = await geometryLoader.loadAndCacheGeometry(id, options);
    console.log(`${format}: loaded, ${data.defaultActor.getMapper().getInputData().getNumberOfPoints()} points`);
  } catch (error) {
    console.log(`${format}: ${error.name}${/404|Not found/.test(error.message) ? ', tells 404' : ''}`);
  }
}
server.close();
M
seen=$(node load.mjs 2>/dev/null)
echo "$seen"
want='PLY: loaded, 0 points
OBJ: loaded, 0 points
STL: RangeError
VTP: HierarchyRequestError'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
