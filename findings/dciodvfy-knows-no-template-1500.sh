#!/bin/sh
# Guess: dciodvfy, which verifies DICOM objects and knows Enhanced SR, also holds a report against the template that it names. A report
#   by TID 1500 that lacks every required row, and whose only item is a volume in millimetres, gives errors.
# Seen: no error and status 0: only attributes and value types are looked at, not templates, coded concepts or units. dsrdump prints the
#   report without a remark. Who writes reports needs another check that a reader will find the measurements.
# Packages: Debian 12: dicom3tools 1.00~20220618093127-2; DCMTK 3.6.7 (dcmtk and libdcmtk17 3.6.7-9~deb12u4). Date: 2026-11-29.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download dicom3tools=1.00~20220618093127-2 dcmtk=3.6.7-9~deb12u4 libdcmtk17=3.6.7-9~deb12u4 libpng16-16=1.6.39-2+deb12u6 \
  libtiff6=4.5.0-6+deb12u4 libxml2=2.9.14+dfsg-1.3~deb12u6 libicu72=72.1-3+deb12u1 libjpeg62-turbo=1:2.1.5-2 libwebp7=1.2.4-0.2+deb12u1 \
  libjbig0=2.1-6.1 liblerc4=4.0.0+ds-2 libdeflate0=1.14-1 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
LD_LIBRARY_PATH=$(dirname "$(find "$t/tree" -name 'libdcmdata.so.17')")
DCMDICTPATH=$(find tree -name dicom.dic | head -1)
export LD_LIBRARY_PATH DCMDICTPATH
# code VALUE SCHEME MEANING: a sequence of one code.
code() { printf '%s SQ\n(fffe,e000) na\n(0008,0100) SH [%s]\n(0008,0102) SH [%s]\n(0008,0104) LO [%s]\n(fffe,e00d)\n(fffe,e0dd)\n' "$@"; }
uid=1.2.826.0.1.3680043.10.1
{
  cat <<D
(0008,0016) UI [1.2.840.10008.5.1.4.1.1.88.22]
(0008,0018) UI [$uid.1]
(0008,0020) DA [20260101]
(0008,0023) DA [20260101]
(0008,0030) TM [120000]
(0008,0033) TM [120000]
(0008,0060) CS [SR]
(0008,0070) LO [nobody]
(0008,1090) LO [nothing]
(0018,1000) LO [1]
(0018,1020) LO [1]
(0020,000d) UI [$uid.2]
(0020,000e) UI [$uid.3]
(0020,0011) IS [1]
(0020,0013) IS [1]
(0040,a040) CS [CONTAINER]
(0040,a050) CS [SEPARATE]
(0040,a491) CS [COMPLETE]
(0040,a493) CS [UNVERIFIED]
D
  for empty in '(0008,0050) SH' '(0008,0090) PN' '(0010,0010) PN' '(0010,0020) LO' '(0010,0030) DA' '(0010,0040) CS' '(0020,0010) SH'; do echo "$empty []"; done
  printf '(0008,1111) SQ\n(fffe,e0dd)\n(0040,a372) SQ\n(fffe,e0dd)\n'
  code '(0040,a043)' 126000 DCM 'Imaging Measurement Report'
  printf '(0040,a504) SQ\n(fffe,e000) na\n(0008,0105) CS [DCMR]\n(0040,db00) CS [1500]\n(fffe,e00d)\n(fffe,e0dd)\n'
  printf '(0040,a730) SQ\n(fffe,e000) na\n(0040,a010) CS [CONTAINS]\n(0040,a040) CS [NUM]\n'
  code '(0040,a043)' 118565006 SCT Volume
  printf '(0040,a300) SQ\n(fffe,e000) na\n(0040,a30a) DS [12.5]\n'
  code '(0040,08ea)' mm UCUM millimeter
  printf '(fffe,e00d)\n(fffe,e0dd)\n(fffe,e00d)\n(fffe,e0dd)\n'
} >report.dump
tree/usr/bin/dump2dcm +te report.dump report.dcm
status=0
tree/usr/bin/dciodvfy report.dcm >said 2>&1 || status=$?
errors=$(grep -c '^Error' said || true)  # grep fails if there is none
remarks=$(tree/usr/bin/dsrdump report.dcm 2>&1 >/dev/null | wc -l)
echo "dciodvfy: status $status, $errors errors; it calls the object $(grep "^Enhanced" said); dsrdump: $remarks remarks"
[ "$status $errors $remarks" = "0 0 0" ] && grep -qx EnhancedSR said || { echo "changed"; exit 1; }
