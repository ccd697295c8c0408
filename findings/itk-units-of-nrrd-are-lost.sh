#!/bin/sh
# Guess: ITK's images are in millimetres, so its readers convert a header's unit of length. Three files of samples 500 µm apart, a NIfTI, an NRRD
#   (`space units`) and a MetaImage (`DistanceUnits`), all have the spacing 0.5.
# Seen: the NIfTI has. The NRRD and the MetaImage have the spacing 500, without a warning: a specimen of 2 mm is 2 m large.
# Packages: npm @itk-wasm/image-io 1.6.1. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @itk-wasm/image-io@1.6.1 >npm.log 2>&1
cat >write.py <<'P'
import struct

samples = bytes(2 * 4 ** 3)
nifti = bytearray(352)
struct.pack_into('<i', nifti, 0, 348)
struct.pack_into('<8h', nifti, 40, 3, 4, 4, 4, 1, 1, 1, 1)
struct.pack_into('<2h', nifti, 70, 4, 16)
struct.pack_into('<4f', nifti, 76, 1, 500, 500, 500)
struct.pack_into('<2f', nifti, 108, 352, 1)
nifti[123] = 3  # NIFTI_UNITS_MICRON
struct.pack_into('<h', nifti, 252, 1)
nifti[344:348] = b'n+1\0'
nrrd = b'''NRRD0004
type: short
endian: little
encoding: raw
dimension: 3
sizes: 4 4 4
space: left-posterior-superior
space directions: (500,0,0) (0,500,0) (0,0,500)
space units: "um" "um" "um"

'''
meta = b'''ObjectType = Image
NDims = 3
BinaryData = True
BinaryDataByteOrderMSB = False
DimSize = 4 4 4
ElementSpacing = 500 500 500
DistanceUnits = um
ElementType = MET_SHORT
ElementDataFile = LOCAL
'''
for name, header in ('a.nii', nifti), ('a.nrrd', nrrd), ('a.mha', meta):
    with open(name, 'wb') as file: file.write(header + samples)
P
python3 write.py
cat >read.mjs <<'M'
import { readImageNode } from '@itk-wasm/image-io';
const seen = [];
for (const name of ['a.nii', 'a.nrrd', 'a.mha']) seen.push(`${name}: ${(await readImageNode(name)).spacing.join(' ')}`);
console.log(seen.join(', '));
M
seen=$(node read.mjs)
echo "$seen"
[ "$seen" = 'a.nii: 0.5 0.5 0.5, a.nrrd: 500 500 500, a.mha: 500 500 500' ] || { echo "changed: $seen"; exit 1; }
