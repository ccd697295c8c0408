#!/bin/sh
# Guess: a mask of one bit a sample is read alike with the tag BitsPerSample and without it, as tifffile writes masks: TIFF 6 says that
#   it is 1 then. Libraries of JavaScript that give samples, not a picture, give the bits.
# Seen: without the tag geotiff and tiff fail. With it geotiff gives the bits, and tiff their opposite, as if for a screen, where white is
#   0 here: the background becomes the mask. utif2 reads both; it makes pixels for a screen, white where the bit is 0.
# Packages: npm geotiff 3.0.5, tiff 7.1.3, utif2 4.1.0. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix "$t" --no-audit --no-fund --ignore-scripts --silent geotiff@3.0.5 tiff@7.1.3 utif2@4.1.0 >npm.log 2>&1
cat >read.mjs <<'J'
import { fromArrayBuffer } from 'geotiff';
import { decode } from 'tiff';
import UTIF from 'utif2';

// 8 x 2 pixels, white is 0: a row of 0 1 0 1 0 1 0 1 and one of ones. Entries of a directory: tag, type, count, value.
function mask(hasBits) {
  const first = [[256, 3, 1, 8], [257, 3, 1, 2], ...(hasBits ? [[258, 3, 1, 1]] : [])];
  const entries = [...first, [259, 3, 1, 1], [262, 3, 1, 0], [273, 4, 1, 8], [277, 3, 1, 1], [278, 3, 1, 2], [279, 4, 1, 2]];
  const view = new DataView(new ArrayBuffer(10 + 2 + 12 * entries.length + 4));
  [0x49, 0x49, 42, 0, 10, 0, 0, 0, 0x55, 0xff].forEach((byte, at) => view.setUint8(at, byte));
  view.setUint16(10, entries.length, true);
  entries.forEach(([tag, type, count, value], at) => {
    [tag, type].forEach((number, half) => view.setUint16(12 + 12 * at + 2 * half, number, true));
    [count, value].forEach((number, half) => view.setUint32(16 + 12 * at + 4 * half, number, true));
  });
  return view.buffer;
}

const readers = {
  geotiff: async (file) => (await (await (await fromArrayBuffer(file)).getImage()).readRasters())[0],
  tiff: (file) => decode(new Uint8Array(file))[0].data,
  utif2: (file) => {
    const [page] = UTIF.decode(file);
    UTIF.decodeImage(file, page);
    return UTIF.toRGBA8(page).filter((_, at) => at % 4 === 0);
  },
};
for (const [name, read] of Object.entries(readers)) {
  for (const hasBits of [true, false]) {
    let result;
    try {
      result = [...(await read(mask(hasBits))).slice(0, 4)].join(' ');
    } catch (error) {
      result = error.message;
    }
    console.log(`${name}, ${hasBits ? 'with' : 'without'} BitsPerSample: ${result}`);
  }
}
J
seen=$(node read.mjs)
echo "$seen"
want='geotiff, with BitsPerSample: 0 1 0 1
geotiff, without BitsPerSample: Expected BitsPerSample to be an array or typed array.
tiff, with BitsPerSample: 1 0 1 0
tiff, without BitsPerSample: Unsupported bitDepth: undefined
utif2, with BitsPerSample: 255 0 255 0
utif2, without BitsPerSample: 255 0 255 0'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
