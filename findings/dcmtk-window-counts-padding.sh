#!/bin/sh
# Guess: a window from the smallest to the largest value leaves out the samples that the header declares as padding (0028,0120), because
#   they are no part of the image. So air of a CT becomes black and tissue white.
# Seen: dcm2pnm +Wm counts the padding: from -3024 (padding), -1000 and 40 it makes 0, 168 and 255, so air is light grey. +Wn, which leaves
#   out the extreme values, makes air black, because padding of one value happens to be the extreme one.
# Packages: Debian 12: dcmtk and libdcmtk17 3.6.7-9~deb12u4, with the libraries below. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download dcmtk=3.6.7-9~deb12u4 libdcmtk17=3.6.7-9~deb12u4 libpng16-16=1.6.39-2+deb12u6 libtiff6=4.5.0-6+deb12u4 \
  libxml2=2.9.14+dfsg-1.3~deb12u6 libicu72=72.1-3+deb12u1 libjpeg62-turbo=1:2.1.5-2 libwebp7=1.2.4-0.2+deb12u1 libjbig0=2.1-6.1 \
  liblerc4=4.0.0+ds-2 libdeflate0=1.14-1 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
LD_LIBRARY_PATH=$(dirname "$(find "$t/tree" -name 'libdcmdata.so.17')")
DCMDICTPATH=$(find tree -name dicom.dic | head -1)
export LD_LIBRARY_PATH DCMDICTPATH
# f430 is -3024, fc18 -1000 and 0028 40.
cat >ct.dump <<'D'
(0008,0016) UI =CTImageStorage
(0008,0018) UI [1.2.3.4]
(0008,0060) CS [CT]
(0028,0002) US 1
(0028,0004) CS [MONOCHROME2]
(0028,0010) US 2
(0028,0011) US 4
(0028,0100) US 16
(0028,0101) US 16
(0028,0102) US 15
(0028,0103) US 1
(0028,0120) SS -3024
(0028,1052) DS [0]
(0028,1053) DS [1]
(7fe0,0010) OW f430\f430\fc18\fc18\fc18\0028\0028\0028
D
tree/usr/bin/dump2dcm -q ct.dump ct.dcm
tree/usr/bin/dcm2pnm -q +Wm +op ct.dcm window.pgm
tree/usr/bin/dcm2pnm -q +Wn +op ct.dcm inner.pgm
seen=$(python3 -c "
print(*(list(open(name, 'rb').read()[-8:]) for name in ('window.pgm', 'inner.pgm')))")
echo "$seen"
[ "$seen" = '[0, 0, 168, 168, 168, 255, 255, 255] [0, 0, 0, 0, 0, 255, 255, 255]' ] || { echo "changed: $seen"; exit 1; }
