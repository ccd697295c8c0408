#!/bin/sh
# Guess: a single NIfTI-1 file whose vox_offset is 0, which cannot be, is rejected like other offsets within the header ("vox offset 348 too
#   low"), or its samples are read behind the header.
# Seen: nibabel rejects 348, but takes 0 literally: the header and its flags are read as the first 176 samples, and the last 176 are missing.
#   There is no warning. The first sample is 348, the field that gives the size of the header.
# Packages: Debian 12: python3-nibabel 5.0.0-2, python3-numpy 1:1.24.2-1+deb12u1. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download python3-nibabel=5.0.0-2 python3-numpy=1:1.24.2-1+deb12u1 libblas3=3.11.0-2 liblapack3=3.11.0-2 libgfortran5=12.2.0-14+deb12u1 \
  libquadmath0=12.2.0-14+deb12u1 python3-packaging=23.0-1 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
cat >read.py <<'P'
import struct
import nibabel

def nifti(vox_offset):
    header = bytearray(352)
    struct.pack_into('<i', header, 0, 348)
    struct.pack_into('<8h', header, 40, 3, 8, 8, 8, 1, 1, 1, 1)
    struct.pack_into('<2h', header, 70, 4, 16)
    struct.pack_into('<8f', header, 76, *[1] * 8)
    struct.pack_into('<2f', header, 108, vox_offset, 1)
    struct.pack_into('<h', header, 254, 1)
    for at in (280, 300, 320): struct.pack_into('<f', header, at, 1)
    header[344:348] = b'n+1\0'
    return bytes(header) + struct.pack('<512h', *[7] * 512)

def first_and_last(vox_offset):
    open('a.nii', 'wb').write(nifti(vox_offset))
    try:
        samples = nibabel.load('a.nii').get_fdata()
    except nibabel.spatialimages.HeaderDataError:
        return 'rejected'
    return f'{samples[0, 0, 0]:.0f} .. {samples[7, 7, 7]:.0f}'

print(', '.join(f'{offset}: {first_and_last(offset)}' for offset in (352, 348, 0)))
P
libraries=$(find tree/usr/lib -name '*.so.3' -o -name 'lib*.so.*' | xargs -n 1 dirname | sort -u | sed "s|^|$t/|" | paste -sd:)
seen=$(LD_LIBRARY_PATH=$libraries PYTHONPATH=tree/usr/lib/python3/dist-packages /usr/bin/python3 -S read.py)
echo "$seen"
[ "$seen" = '352: 7 .. 7, 348: rejected, 0: 348 .. 7' ] || { echo "changed: $seen"; exit 1; }
