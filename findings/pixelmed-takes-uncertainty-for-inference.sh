#!/bin/sh
# Guess: PixelMed's DicomSRValidator, which holds a structured report against the template that it names, accepts the uncertainty
#   of a measured number where TID 310 of PS3.16 puts it: as a property (HAS PROPERTIES) of the number.
# Seen: two errors "Incorrect relationship - expected INFERRED FROM". The rows 9 and 10 of TID 300 let a number be inferred from any other
#   number, and the validator takes the uncertainty for such a one; without the uncertainty there is no error at this number. Who
#   follows the message writes that the volume was inferred from its uncertainty.
# Packages: Debian 12: libpixelmed-java 20220618+dfsg-1 with openjdk-17-jre-headless 17.0.21.1+2-1~deb12u1, libjsonp-java 1.1.2-3,
#   libslf4j-java 1.7.32-1; report made with DCMTK 3.6.7 (dcmtk 3.6.7-9~deb12u4). Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download libpixelmed-java=20220618+dfsg-1 openjdk-17-jre-headless=17.0.21.1+2-1~deb12u1 libjsonp-java=1.1.2-3 libslf4j-java=1.7.32-1 \
  dcmtk=3.6.7-9~deb12u4 libdcmtk17=3.6.7-9~deb12u4 libpng16-16=1.6.39-2+deb12u6 libtiff6=4.5.0-6+deb12u4 libxml2=2.9.14+dfsg-1.3~deb12u6 \
  libicu72=72.1-3+deb12u1 libjpeg62-turbo=1:2.1.5-2 libwebp7=1.2.4-0.2+deb12u1 libjbig0=2.1-6.1 liblerc4=4.0.0+ds-2 \
  libdeflate0=1.14-1 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
LD_LIBRARY_PATH=$(dirname "$(find "$t/tree" -name 'libdcmdata.so.17')")
DCMDICTPATH=$(find "$t/tree" -name dicom.dic | head -1)
export LD_LIBRARY_PATH DCMDICTPATH
# sequence TAG CODE SCHEME MEANING; item RELATION TYPE CODE SCHEME MEANING opens an item of the content; close CLOSED: its end.
sequence() { printf '%s SQ\n(fffe,e000) na\n(0008,0100) SH [%s]\n(0008,0102) SH [%s]\n(0008,0104) LO [%s]\n(fffe,e00d)\n(fffe,e0dd)\n' "$@"; }
item() { printf '(fffe,e000) na\n(0040,a010) CS [%s]\n(0040,a040) CS [%s]\n' "$1" "$2"; sequence '(0040,a043)' "$3" "$4" "$5"; }
number() { printf '(0040,a300) SQ\n(fffe,e000) na\n(0040,a30a) DS [%s]\n' "$1"; sequence '(0040,08ea)' mm3 UCUM 'cubic millimeter'; printf '(fffe,e00d)\n(fffe,e0dd)\n'; }
report() {
  printf '(0008,0016) UI [1.2.840.10008.5.1.4.1.1.88.22]\n(0008,0018) UI [1.2.826.0.1.3680043.10.1.1]\n(0040,a040) CS [CONTAINER]\n(0040,a050) CS [SEPARATE]\n'
  sequence '(0040,a043)' 126000 DCM 'Imaging Measurement Report'
  printf '(0040,a504) SQ\n(fffe,e000) na\n(0008,0105) CS [DCMR]\n(0040,db00) CS [1500]\n(fffe,e00d)\n(fffe,e0dd)\n(0040,a730) SQ\n'
  item CONTAINS CONTAINER 126010 DCM 'Imaging Measurements'
  printf '(0040,a050) CS [SEPARATE]\n(0040,a730) SQ\n'
  item CONTAINS CONTAINER 125007 DCM 'Measurement Group'
  printf '(0040,a050) CS [SEPARATE]\n(0040,a730) SQ\n'
  item CONTAINS NUM 118565006 SCT Volume
  number 12.5
  [ "$1" = 0 ] || {
    printf '(0040,a730) SQ\n'
    item 'HAS PROPERTIES' NUM 371884006 SCT '+/-, range of measurement uncertainty'
    number 0.5
    printf '(fffe,e00d)\n(fffe,e0dd)\n'
  }
  for level in 1 2 3; do printf '(fffe,e00d)\n(fffe,e0dd)\n'; done
}
found=
for with in 0 1; do
  report $with >report.dump
  tree/usr/bin/dump2dcm +te report.dump report.dcm
  # Without these limits Java 17 does not take the templates of the validator at all.
  tree/usr/lib/jvm/java-17-openjdk-amd64/bin/java -Djdk.xml.xpathExprGrpLimit=0 -Djdk.xml.xpathExprOpLimit=0 -Djdk.xml.xpathTotalOpLimit=0 \
    -cp "$(find "$t/tree" -name '*.jar' | tr '\n' ':')" com.pixelmed.validate.DicomSRValidator report.dcm >said 2>&1
  found="$found$(grep -c 'expected INFERRED FROM - found HAS PROPERTIES' said || true) "  # grep fails if there is none
  grep -q 'Root Template Validation Complete' said || { cat said; exit 1; }
done
echo "errors of relationship without and with an uncertainty: $found"
[ "$found" = "0 2 " ] || { echo "changed"; exit 1; }
