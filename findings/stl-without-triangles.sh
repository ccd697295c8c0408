#!/bin/sh
# Guess: an STL file of no triangles is an empty mesh for every reader, as text and as binary.
# Seen: each of two readers takes one of the kinds for the other one. three's STLLoader reads the binary file as 0 triangles,
#   but throws a RangeError for the text file ("Offset is outside the bounds of the DataView"), which it takes for binary.
#   vtkSTLReader reads the text file as 0 triangles. It takes the binary one for text and reports "Premature EOF while
#   reading 'solid'"; its GetErrorCode() is 0 all the same.
# Packages: npm three 0.187.0; Debian 12: python3-vtk9 9.1.0+really9.1.0+dfsg2-5+deb12u1. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix "$t" --no-audit --no-fund --ignore-scripts --silent three@0.187.0 >npm.log 2>&1
# The packages of VTK, and those it depends on, that this machine lacks. Nothing is installed.
apt-get -s --no-install-recommends install python3-vtk9=9.1.0+really9.1.0+dfsg2-5+deb12u1 |
  awk '/^Inst/ { print $2 }' | xargs -r apt-get download >apt.log 2>&1
for package in *.deb; do [ ! -e "$package" ] || dpkg -x "$package" tree; done
libraries="tree/usr/lib/$(uname -m)-linux-gnu"
export PYTHONPATH="$t/tree/usr/lib/python3/dist-packages"
export LD_LIBRARY_PATH="$t/$libraries:$t/$libraries/blas:$t/$libraries/lapack:$t/$libraries/openmpi/lib"
{ printf '%-80s' 'A mesh in millimetres' && head -c 4 /dev/zero; } >binary.stl # a comment, and the number of triangles
printf 'solid empty\nendsolid empty\n' >text.stl
cat >read.mjs <<'J'
import { readFileSync } from 'node:fs';
import { STLLoader } from 'three/examples/jsm/loaders/STLLoader.js';
for (const name of ['binary', 'text']) {
  const bytes = new Uint8Array(readFileSync(`${name}.stl`));
  let result;
  try {
    result = `${new STLLoader().parse(bytes.buffer).attributes.position.count / 3} triangles`;
  } catch (error) {
    result = error.name;
  }
  console.log(`three, ${name}: ${result}`);
}
J
cat >read.py <<'P'
import vtk
for name in 'binary', 'text':
    errors = []
    reader = vtk.vtkSTLReader()
    reader.AddObserver('ErrorEvent', lambda *event: errors.append(event))
    reader.SetFileName(name + '.stl')
    reader.Update()
    print(f'VTK, {name}: {reader.GetOutput().GetNumberOfPolys()} triangles, '
          f'{"an error" if errors else "no error"}, code {reader.GetErrorCode()}')
P
seen=$(node read.mjs && /usr/bin/python3 read.py 2>/dev/null)
echo "$seen"
want='three, binary: 0 triangles
three, text: RangeError
VTK, binary: 0 triangles, an error, code 0
VTK, text: 0 triangles, no error, code 0'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
