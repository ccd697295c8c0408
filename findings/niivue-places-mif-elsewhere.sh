#!/bin/sh
# Guess: NiiVue reads MRtrix's MIF, so it places a volume where MRtrix does, also if the header has no `transform`, which the format allows.
# Seen: MRtrix puts the middle of the volume at the origin: the first voxel of 4 x 4 x 4 voxels of 2 mm is at (-3, -3, -3). NiiVue puts it at
#   (0, 0, 0), without a warning, so a surface made in one lies beside the volume in the other.
# Packages: Debian mrtrix3 3.0.3-3+b1, npm @niivue/niivue 0.69.0. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @niivue/niivue@0.69.0 >npm.log 2>&1
apt-get download mrtrix3=3.0.3-3+b1 >apt.log 2>&1
dpkg -x mrtrix3_*.deb tree
python3 - <<'P'
head = b'mrtrix image\ndim: 4,4,4\nvox: 2,2,2\nlayout: +0,+1,+2\ndatatype: UInt8\nfile: . 256\nEND\n'
with open('a.mif', 'wb') as file: file.write(head.ljust(256, b'\0') + bytes(range(64)))
P
cat >read.mjs <<'M'
import { readFileSync } from 'node:fs';
globalThis.window = globalThis;
globalThis.self = globalThis;
globalThis.document = { createElement: () => ({ getContext: () => null }) };
console.warn = () => {};
const { NVImage } = await import('@niivue/niivue');
const bytes = readFileSync('a.mif');
const image = await NVImage.new(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), 'a.mif');
console.log(image.hdr.affine.slice(0, 3).map((row) => row[3]).join(' '));
M
mrinfo=$(find tree -name mrinfo -type f | head -n 1)
seen="MRtrix: $(LD_LIBRARY_PATH="$(find tree -name 'libmrtrix*' -printf '%h\n' | head -n 1)" "$mrinfo" -quiet -transform a.mif | head -n 3 | awk '{ print $4 }' | xargs)"
seen="$seen, NiiVue: $(node read.mjs 2>/dev/null | tail -n 1)"
echo "$seen"
[ "$seen" = 'MRtrix: -3 -3 -3, NiiVue: 0 0 0' ] || { echo "changed: $seen"; exit 1; }
