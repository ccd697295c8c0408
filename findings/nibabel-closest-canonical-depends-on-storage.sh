#!/bin/sh
# Guess: `nibabel.as_closest_canonical` brings a scan into one form, so a scan that was stored twice, with its first two axes exchanged and the
#   affine with them, comes out as the same array.
# Seen: for axes that lie 45 degrees between two axes of the patient it does not. Both copies say R, A, S afterwards, every voxel stays at its
#   place, and the arrays have the shapes (2, 3, 4) and (3, 2, 4). As stored, the codes of the two are RAS and LAS. The order of the file decides
#   which axis is taken for "right", so programs that compare or cache such arrays take one scan for two.
# Packages: Debian 12: python3-nibabel 5.0.0-2, python3-numpy 1:1.24.2-1+deb12u1. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download python3-nibabel=5.0.0-2 python3-numpy=1:1.24.2-1+deb12u1 libblas3=3.11.0-2 liblapack3=3.11.0-2 libgfortran5=12.2.0-14+deb12u1 \
  libquadmath0=12.2.0-14+deb12u1 python3-packaging=23.0-1 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
cat >compare.py <<'P'
import nibabel
import numpy

half = numpy.sqrt(0.5)
samples = numpy.arange(24, dtype=numpy.int16).reshape(2, 3, 4)
affine = numpy.eye(4)
affine[:2, :2] = [[half, -half], [half, half]]
exchanged = affine[:, [1, 0, 2, 3]]

def places(image):
    """The place of each sample, by its value."""
    return {int(image.dataobj[i, j, k]): tuple(numpy.round(image.affine @ (i, j, k, 1), 4) + 0.0)
            for i, j, k in numpy.ndindex(image.shape)}

scans = [nibabel.Nifti1Image(samples, affine), nibabel.Nifti1Image(samples.transpose(1, 0, 2).copy(), exchanged)]
same = [nibabel.as_closest_canonical(scan) for scan in scans]
for scan, canonical in zip(scans, same):
    print(*nibabel.aff2axcodes(scan.affine), 'becomes', *nibabel.aff2axcodes(canonical.affine), canonical.shape)
print('one place for each value:', len({tuple(sorted(places(image).items())) for image in scans + same}) == 1)
P
libraries="tree/usr/lib/$(uname -m)-linux-gnu"
seen=$(PYTHONPATH="$t/tree/usr/lib/python3/dist-packages" LD_LIBRARY_PATH="$t/$libraries:$t/$libraries/blas:$t/$libraries/lapack" \
  /usr/bin/python3 compare.py | paste -sd'|')
echo "$seen" | tr '|' '\n'
[ "$seen" = 'R A S becomes R A S (2, 3, 4)|L A S becomes R A S (3, 2, 4)|one place for each value: True' ] || { echo changed; exit 1; }
