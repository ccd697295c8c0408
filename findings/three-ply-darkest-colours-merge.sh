#!/bin/sh
# Guess: PLYLoader keeps the 256 greys that vertices of a PLY may have (`property uchar`) apart, as GLTFLoader and three 0.180 do.
# Seen: three 0.187 converts them from sRGB to linear light and rounds that to bytes again: 256 greys become 183, 0 to 6 all become black,
#   and the colour 204 51 17 is drawn as 204 50 13. three 0.180 has floats, and 256 greys.
# Packages: npm three 0.187.0 and 0.180.0. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
for version in 0.187.0 0.180.0; do
  npm install --prefix "$version" --ignore-scripts --no-audit --no-fund --no-save "three@$version" >npm.log 2>&1
  cat >"$version/read.mjs" <<'M'
import { Color, LinearSRGBColorSpace } from 'three';
import { PLYLoader } from 'three/examples/jsm/loaders/PLYLoader.js';
const colours = [...Array.from({ length: 256 }, (_, grey) => [grey, grey, grey]), [204, 51, 17]];
const header = `ply
format ascii 1.0
element vertex ${colours.length}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
end_header
`;
const text = `${header}${colours.map((colour, at) => `${at} ${at % 2} 0 ${colour.join(' ')}`).join('\n')}\n3 0 1 2\n`;
const { color } = new PLYLoader().parse(text).attributes;
// As a renderer shows them: linear light, to sRGB.
const shown = colours.map((_, at) => {
  const { r, g, b } = new Color().setRGB(color.getX(at), color.getY(at), color.getZ(at), LinearSRGBColorSpace).convertLinearToSRGB();
  return [r, g, b].map((value) => Math.round(255 * value)).join(' ');
});
const greys = shown.slice(0, 256);
console.log(`${color.array.constructor.name}: ${new Set(greys).size} greys, ${greys.lastIndexOf('0 0 0') + 1} of them black, ${shown[256]}`);
M
done
seen=$(for version in 0.187.0 0.180.0; do echo "$version $(node "$version/read.mjs")"; done)
echo "$seen"
[ "$seen" = '0.187.0 Uint8Array: 183 greys, 7 of them black, 204 50 13
0.180.0 Float32Array: 256 greys, 1 of them black, 204 51 17' ] || { echo changed; exit 1; }
