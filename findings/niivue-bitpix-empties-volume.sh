#!/bin/sh
# Guess: a NIfTI header whose bitpix contradicts its datatype is rejected, or the datatype wins, as in nibabel and ITK: the code 4 means
#   int16, and bitpix only repeats it.
# Seen: NiiVue loads the volume without an error, and every sample is 0. With the right bitpix, the same bytes are 0 to 63.
# Packages: npm @niivue/niivue 0.69.0. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @niivue/niivue@0.69.0 >npm.log 2>&1
cat >read.mjs <<'M'
globalThis.window = globalThis;
globalThis.self = globalThis;
globalThis.document = { createElement: () => ({ getContext: () => null }) };
console.warn = () => {};
const { NVImage } = await import('@niivue/niivue');

// 4 x 4 x 4 samples of int16: 0 to 63.
function nifti(bitpix) {
  const bytes = Buffer.alloc(352 + 128);
  bytes.writeInt32LE(348, 0);
  [3, 4, 4, 4, 1, 1, 1, 1].forEach((size, at) => bytes.writeInt16LE(size, 40 + 2 * at));
  bytes.writeInt16LE(4, 70);
  bytes.writeInt16LE(bitpix, 72);
  for (let at = 0; at < 8; at += 1) bytes.writeFloatLE(1, 76 + 4 * at);
  bytes.writeFloatLE(352, 108);
  bytes.writeInt16LE(1, 254);
  for (const at of [280, 300, 320]) bytes.writeFloatLE(1, at);
  bytes.write('n+1\0', 344, 'latin1');
  for (let at = 0; at < 64; at += 1) bytes.writeInt16LE(at, 352 + 2 * at);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
}

const found = [];
for (const bitpix of [16, 8]) {
  const image = await NVImage.new(nifti(bitpix), 'a.nii');
  found.push(`bitpix ${bitpix}: ${image.global_min} to ${image.global_max}`);
}
console.log(found.join(', '));
M
seen=$(node read.mjs 2>/dev/null | tail -1)
echo "$seen"
[ "$seen" = 'bitpix 16: 0 to 63, bitpix 8: 0 to 0' ] || { echo "changed: $seen"; exit 1; }
