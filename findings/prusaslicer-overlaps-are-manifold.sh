#!/bin/sh
# Guess: `prusa-slicer --info` says whether a file can be printed: for two cubes in the same place, or one half inside the other, it says
#   that something is wrong, and the volume is that of the space they fill, 1000 and 1875 mm3.
# Seen: manifold = yes for both, and a volume of 2000 mm3: edges are counted, and the volumes of the parts are added. Overlaps need another
#   check, and the volume of a file whose parts overlap is no amount of material.
# Packages: Debian 12: prusa-slicer 2.5.0+dfsg-4, with the libraries below. Date: 2026-11-29.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
pinned="prusa-slicer=2.5.0+dfsg-4 libexpat1=2.5.0-1+deb12u5 libopenvdb10.0=10.0.1-2 libblosc1=1.21.3+ds-1 libtbb12=2021.8.0-2+deb12u1
  libnlopt0=2.7.1-5 libimath-3-1-29=3.1.6-1 libmpfr6=4.2.0-1 libgmp10=2:6.2.1+dfsg1-1.1"
for library in log filesystem locale thread regex chrono iostreams; do pinned="$pinned libboost-$library""1.74.0=1.74.0+ds1-21"; done
# Libraries of its window that this machine lacks, of any version.
for name in $(apt-get install --simulate --no-install-recommends $pinned | sed -n "s/^Inst \(lib[^ ]*\) .*/\1/p"); do
  case " $pinned " in *" $name="*) ;; *) pinned="$pinned $name" ;; esac
done
apt-get download $pinned >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
export LD_LIBRARY_PATH="$t/tree/usr/lib/$(uname -m)-linux-gnu:$t/tree/lib/$(uname -m)-linux-gnu"
cat >cubes.py <<'P'
import struct
faces = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)]
def write(name, begins):
    with open(name, 'wb') as file:
        file.write(bytes(80) + struct.pack('<I', 12 * len(begins)))
        for begin in begins:
            corners = [(begin + a, begin + b, begin + c) for c in (0, 10) for b in (0, 10) for a in (0, 10)]
            for face in faces:
                p, q, r = (corners[corner] for corner in face)
                u, v = ([x - y for x, y in zip(each, p)] for each in (q, r))
                normal = [(u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2]) / 100 for i in range(3)]
                file.write(struct.pack('<12fH', *normal, *p, *q, *r, 0))
write('same.stl', [0, 0])
write('half.stl', [0, 5])
P
python3 cubes.py
seen=
for name in same half; do
  tree/usr/bin/prusa-slicer --datadir "$t/data" --info $name.stl >log 2>&1
  told=$(sed -n -e 's/^manifold = /manifold: /p' -e 's/^facets_reversed.*/reversed/p' -e 's/^volume = \([0-9]*\).*/\1/p' log | tr '\n' ' ')
  echo "$name: $told"
  seen="$seen|$told"
done
# The sum of the volumes is a little below or above 2000.
case "$seen" in '|manifold: yes '1999' |manifold: yes '2000' ' | '|manifold: yes '2000' |manifold: yes '2000' ') ;; *) echo "changed"; exit 1 ;; esac
