#!/bin/sh
# Guess: if one of two separate cubes in an STL file is inside out, ADMesh turns it, or leaves both alone and says so. It counts the parts, and
#   its normal directions are checked and fixed.
# Seen: ADMesh looks at the sum of the volumes. A small cube that is inside out beside a large one stays so, and all counts are 0. If
#   the large one is inside out, ADMesh turns both, so the small one, which was right, is inside out afterwards. The volume that it
#   reports is the difference, 936 of 1064 mm3, and nothing warns.
# Packages: Debian 12: admesh and libadmesh1 0.98.4-2. Date: 2026-11-29.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download admesh=0.98.4-2 libadmesh1=0.98.4-2 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
export LD_LIBRARY_PATH="$t/tree/usr/lib/$(uname -m)-linux-gnu"
cat >cubes.py <<'P'
import sys
FACES = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)]

def make(large, small):
    """Cubes of 10 mm and, 20 mm beside them, 4 mm; each right (1) or inside out (-1)."""
    print('solid cubes')
    for x, size, side in (0, 10, large), (30, 4, small):
        points = [(x + a, b, c) for c in (0, size) for b in (0, size) for a in (0, size)]
        for face in FACES:
            corners = ''.join('vertex %d %d %d\n' % points[at] for at in face[::side])
            print(f'facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet')
    print('endsolid cubes')

def volumes(path):
    corners = [[float(x) for x in line.split()[1:]] for line in open(path) if line.split()[0] == 'vertex']
    found = {'large': 0, 'small': 0}
    for a, b, c in zip(corners[::3], corners[1::3], corners[2::3]):
        cross = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
        found['large' if a[0] < 20 else 'small'] += sum(x * y for x, y in zip(a, cross)) / 6
    print('afterwards', ', '.join(f'{name} {volume:.0f}' for name, volume in found.items()))

if len(sys.argv) == 3: make(int(sys.argv[1]), int(sys.argv[2]))
else: volumes(sys.argv[1])
P
seen=$(for sides in '1 1' '1 -1' '-1 1'; do
  python3 cubes.py $sides >before.stl
  tree/usr/bin/admesh --write-ascii-stl=after.stl before.stl >report
  echo "large and small cube $sides:" "$(sed -n 's/^Number of parts *: *\([0-9]*\) *Volume *: */\1 parts, volume /p;
    s/^Facets reversed *: */reversed /p; s/^Backwards edges *: */backwards edges /p' report | paste -sd,)," "$(python3 cubes.py after.stl)"
done)
echo "$seen"
[ "$seen" = 'large and small cube 1 1: 2 parts, volume 1064.000122,reversed 0,backwards edges 0, afterwards large 1000, small 64
large and small cube 1 -1: 2 parts, volume 935.999939,reversed 0,backwards edges 0, afterwards large 1000, small -64
large and small cube -1 1: 2 parts, volume 936.000000,reversed 24,backwards edges 0, afterwards large 1000, small -64' ] ||
  { echo changed; exit 1; }
