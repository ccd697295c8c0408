#!/bin/sh
# Guess: a receiver that has an object reports 0111 (duplicate SOP instance), or keeps one of both, when another object with the same SOP
#   Instance UID comes: a UID names one object for ever.
# Seen: storescp answers Success, without a warning, and the second object replaces the first. So a program that reuses a UID for a corrected
#   mesh seems to work here. (Orthanc 1.10.1 with OverwriteInstances false answers Success as well, but keeps the first one.)
# Packages: Debian 12: dcmtk and libdcmtk17 3.6.7-9~deb12u4, with the libraries below. Date: 2026-11-29.
# storescp listens on all addresses, so the script runs in a network of its own.
set -eu
if [ $# -eq 0 ]; then
  t=$(mktemp -d)
  trap 'rm -rf "$t"' EXIT
  (cd "$t" && apt-get download dcmtk=3.6.7-9~deb12u4 libdcmtk17=3.6.7-9~deb12u4 libpng16-16=1.6.39-2+deb12u6 libtiff6=4.5.0-6+deb12u4 \
    libxml2=2.9.14+dfsg-1.3~deb12u6 libicu72=72.1-3+deb12u1 libjpeg62-turbo=1:2.1.5-2 libwebp7=1.2.4-0.2+deb12u1 libjbig0=2.1-6.1 \
    liblerc4=4.0.0+ds-2 libdeflate0=1.14-1 libwrap0=7.6.q-32 >apt.log 2>&1)
  unshare --user --map-root-user --net "$0" "$t"
  exit
fi
t=$1
receiver=
finish() {
  [ -z "$receiver" ] || kill "$receiver" 2>/dev/null || true
}
trap finish EXIT
cd "$t"
for package in *.deb; do dpkg -x "$package" tree; done
LD_LIBRARY_PATH=$(dirname "$(find "$t/tree" -name 'libdcmdata.so.17')")
DCMDICTPATH=$(find tree -name dicom.dic | head -1)
export LD_LIBRARY_PATH DCMDICTPATH
ip link set lo up
mkdir received
tree/usr/bin/storescp --quiet --output-directory received 11112 &
receiver=$!
for thickness in 1 2; do
  printf '(0008,0016) UI =CTImageStorage\n(0008,0018) UI [1.2.3.4]\n(0018,0050) DS [%s]\n' "$thickness" >ct.dump
  tree/usr/bin/dump2dcm -q ct.dump "$thickness.dcm"
done
until tree/usr/bin/echoscu localhost 11112 2>/dev/null; do sleep 0.1; done
seen=
for thickness in 1 2; do
  seen="$seen$(tree/usr/bin/storescu --verbose localhost 11112 "$thickness.dcm" 2>&1 | sed -n 's/.*Store Response (\(.*\)).*/\1/p') "
done
seen="$seen$(ls received | wc -l) $(tree/usr/bin/dcmdump --search 0018,0050 received/* | sed 's/.*\[\(.*\)\].*/\1/')"
echo "$seen"
[ "$seen" = 'Success Success 1 2' ] || { echo "changed: $seen"; exit 1; }
