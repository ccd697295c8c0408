#!/bin/sh
# Guess: the validator of structured reports in Debian's libpixelmed-java works with the Java that Debian has, and a script that runs
#   it can tell by its status whether a report was looked at.
# Seen: it looks at no report. It compiles its templates as one XSL style sheet, which has more operators than Java lets an XPath
#   have (JAXP0801003, a limit of the security processing); it prints that, nothing of the report, and ends with status 0.
#   Without these limits (three properties jdk.xml.xpath*Limit=0), the same report is held against TID 1500.
# Packages: Debian 12: libpixelmed-java 20220618+dfsg-1 with openjdk-17-jre-headless 17.0.21.1+2-1~deb12u1; report made with Python. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download libpixelmed-java=20220618+dfsg-1 openjdk-17-jre-headless=17.0.21.1+2-1~deb12u1 libjsonp-java=1.1.2-3 libslf4j-java=1.7.32-1 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
python3 - <<'P'
import struct

def element(group, number, vr, value):
    value += (b"\0" if vr == b"UI" else b" ") * (len(value) % 2)
    long = struct.pack("<HI", 0, len(value)) if vr in (b"SQ", b"OB") else struct.pack("<H", len(value))
    return struct.pack("<HH", group, number) + vr + long + value

def sequence(group, number, *elements):
    item = b"".join(elements)
    return element(group, number, b"SQ", struct.pack("<HHI", 0xfffe, 0xe000, len(item)) + item)

meta = (element(2, 1, b"OB", b"\0\1") + element(2, 2, b"UI", b"1.2.840.10008.5.1.4.1.1.88.22") + element(2, 3, b"UI", b"1.2.826.0.1.3680043.10.1.1")
        + element(2, 16, b"UI", b"1.2.840.10008.1.2.1") + element(2, 18, b"UI", b"1.2.826.0.1.3680043.10.1"))
data = (element(8, 22, b"UI", b"1.2.840.10008.5.1.4.1.1.88.22") + element(8, 24, b"UI", b"1.2.826.0.1.3680043.10.1.1") + element(8, 96, b"CS", b"SR")
        + element(0x40, 0xa040, b"CS", b"CONTAINER")
        + sequence(0x40, 0xa043, element(8, 256, b"SH", b"126000"), element(8, 258, b"SH", b"DCM"), element(8, 260, b"LO", b"Imaging Measurement Report"))
        + element(0x40, 0xa050, b"CS", b"SEPARATE")
        + sequence(0x40, 0xa504, element(8, 0x105, b"CS", b"DCMR"), element(0x40, 0xdb00, b"CS", b"1500")))
open("report.dcm", "wb").write(bytes(128) + b"DICM" + element(2, 0, b"UL", struct.pack("<I", len(meta))) + meta + data)
P
validate() {
  tree/usr/lib/jvm/java-17-openjdk-amd64/bin/java "$@" -cp "$(find "$t/tree" -name '*.jar' | tr '\n' ':')" \
    com.pixelmed.validate.DicomSRValidator report.dcm >said 2>&1
}
status=0
validate || status=$?
limits=$(grep -c '^javax.xml.*JAXP0801003' said || true)  # grep fails if there is none
looked=$(grep -c '^Found Root Template' said || true)
validate -Djdk.xml.xpathExprGrpLimit=0 -Djdk.xml.xpathExprOpLimit=0 -Djdk.xml.xpathTotalOpLimit=0
later=$(grep -c '^Found Root Template TID_1500' said || true)
echo "as it is: status $status, $limits limits exceeded, $looked templates found; without limits: $later template found"
[ "$status $limits $looked $later" = "0 1 0 1" ] || { cat said; echo "changed"; exit 1; }
