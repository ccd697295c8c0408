#!/bin/sh
# Guess: if a receiver refuses the certificate of storescu, storescu says so: its TLS gets an alert (unknown CA).
# Seen: over TLS 1.3, storescu says "Peer aborted Association (or never connected)" or "TCP I/O Error (Connection reset by peer)", as if TLS had
#   nothing to do with it: the client's half of the handshake ends before the server looks at the certificate. If storescu itself refuses the
#   receiver's certificate, it says "TLS error: certificate verify failed". So look into the receiver's log first.
# Packages: Debian 12: dcmtk and libdcmtk17 3.6.7-9~deb12u4, with the libraries below; openssl of the machine makes the certificates.
# Date: 2026-11-30. storescp listens on all addresses, so the script runs in a network of its own.
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
receiver=
finish() {
  [ -z "$receiver" ] || kill "$receiver" 2>/dev/null || true
}
trap finish EXIT
cd "$1"
for package in *.deb; do dpkg -x "$package" tree; done
LD_LIBRARY_PATH=$(dirname "$(find "$1/tree" -name 'libdcmdata.so.17')")
DCMDICTPATH=$(find tree -name dicom.dic | head -1)
for name in receiver stranger; do
  openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=$name -keyout $name.key -out $name.pem 2>/dev/null
done
export LD_LIBRARY_PATH DCMDICTPATH
ip link set lo up
tree/usr/bin/storescp --quiet +tls receiver.key receiver.pem +cf receiver.pem 11112 &
receiver=$!
until tree/usr/bin/echoscu +tls receiver.key receiver.pem +cf receiver.pem localhost 11112 2>/dev/null; do sleep 0.1; done
printf '(0008,0016) UI =CTImageStorage\n(0008,0018) UI [1.2.3.4]\n' >ct.dump
tree/usr/bin/dump2dcm -q ct.dump ct.dcm
said() { # key and certificate, authority: what storescu says
  tree/usr/bin/storescu +tls "$1.key" "$1.pem" +cf "$2.pem" localhost 11112 ct.dcm 2>&1 | grep '^F: Association Request Failed' | tee -a said | grep -o 'TLS error: .*' || true
}
seen="refused there: $(said stranger receiver); refused here: $(said receiver stranger); $(wc -l <said) failures"
cat said
[ "$seen" = 'refused there: ; refused here: TLS error: certificate verify failed; 2 failures' ] || { echo "changed: $seen"; exit 1; }
