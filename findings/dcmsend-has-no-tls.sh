#!/bin/sh
# Guess: dcmsend and dcmrecv, the newer sender and receiver of DCMTK, both speak TLS, as storescu and storescp do: the receiver has --enable-tls.
# Seen: dcmsend has no option for TLS and rejects +tls as unknown. So what dcmrecv receives over TLS, only storescu can send.
# Packages: Debian 12: dcmtk and libdcmtk17 3.6.7-9~deb12u4, with the libraries below. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download dcmtk=3.6.7-9~deb12u4 libdcmtk17=3.6.7-9~deb12u4 libpng16-16=1.6.39-2+deb12u6 libtiff6=4.5.0-6+deb12u4 \
    libxml2=2.9.14+dfsg-1.3~deb12u6 libicu72=72.1-3+deb12u1 libjpeg62-turbo=1:2.1.5-2 libwebp7=1.2.4-0.2+deb12u1 libjbig0=2.1-6.1 \
    liblerc4=4.0.0+ds-2 libdeflate0=1.14-1 libwrap0=7.6.q-32 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
LD_LIBRARY_PATH=$(dirname "$(find "$t/tree" -name 'libdcmdata.so.17')")
DCMDICTPATH=$(find tree -name dicom.dic | head -1)
export LD_LIBRARY_PATH DCMDICTPATH
seen=
for program in storescu storescp dcmrecv dcmsend; do
  seen="$seen$program $(tree/usr/bin/$program --help | grep -c -e --enable-tls || true), "
done
seen="$seen$(tree/usr/bin/dcmsend +tls key.pem certificate.pem localhost 11112 image.dcm 2>&1 | grep -o -i 'unknown option +tls' || true)"
echo "$seen"
[ "$seen" = 'storescu 2, storescp 2, dcmrecv 2, dcmsend 0, Unknown option +tls' ] || { echo "changed: $seen"; exit 1; }
