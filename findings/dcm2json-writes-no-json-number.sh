#!/bin/sh
# Guess: dcm2json writes JSON that every parser reads, because it turns "+1.5", ".5" and "007", which DICOM allows and JSON does not, into
#   1.5, 0.5 and 7.
# Seen: "1.", which DICOM allows as well (a fixed point number whose decimal point ends it), is copied. JSON demands a digit there, so a data
#   set with such a slice thickness or rescale slope cannot be parsed. DICOMweb clients meet this in metadata that was made in this way.
# Packages: Debian 12: dcmtk and libdcmtk17 3.6.7-9~deb12u4, with the libraries below; python3's json. Date: 2026-11-29.
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
seen=
for value in +1.5 .5 007 1E1 1.; do
  printf '(0008,0016) UI =CTImageStorage\n(0008,0018) UI [1.2.3.4]\n(0018,0050) DS [%s]\n' "$value" >ct.dump
  tree/usr/bin/dump2dcm -q ct.dump ct.dcm
  tree/usr/bin/dcm2json ct.dcm ct.json
  said=$(python3 -c "
import json
try:
    print(json.load(open('ct.json'))['00180050']['Value'][0])
except json.JSONDecodeError:
    print('invalid')")
  seen="$seen$value=$said "
done
echo "$seen"
[ "$seen" = '+1.5=1.5 .5=0.5 007=7 1E1=10.0 1.=invalid ' ] || { echo "changed: $seen"; exit 1; }
