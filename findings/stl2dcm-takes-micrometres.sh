#!/bin/sh
# Guess: an STL becomes a DICOM object in millimetres, as 3D printers, slicers and viewers read STL, and as all lengths in DICOM images are.
#   If it does not, the object's units stay empty or the program asks for them.
# Seen: stl2dcm writes the units um (UCUM) without a word, so a skull of 200 mm becomes one of 0.2 mm for a reader that looks at them. The
#   option --measurement-units UCUM mm mm helps.
# Packages: Debian 12: dcmtk and libdcmtk17 3.6.7-9~deb12u4, with the libraries below. Date: 2026-11-29.
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
python3 -c "
import struct
triangle = struct.pack('<12fH', 0, 0, 1, 0, 0, 0, 200, 0, 0, 0, 200, 0, 0)
open('skull.stl', 'wb').write(b'a skull'.ljust(80) + struct.pack('<I', 1) + triangle)"
unit() {
  tree/usr/bin/dcmdump --search 0040,08ea --print-all "$1" | sed -n 's/.*(0008,0100) SH \[\(.*\)\].*/\1/p'
}
tree/usr/bin/stl2dcm --quiet skull.stl default.dcm
tree/usr/bin/stl2dcm --quiet --measurement-units UCUM mm mm skull.stl asked.dcm
seen="$(unit default.dcm) $(unit asked.dcm)"
echo "$seen"
[ "$seen" = 'um mm' ] || { echo "changed: $seen"; exit 1; }
