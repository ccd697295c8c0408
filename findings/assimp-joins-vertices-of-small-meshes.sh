#!/bin/sh
# Guess: joining identical vertices never changes the shape of a mesh, whatever its unit is.
# Seen: assimp joins vertices that are less than about 1e-5 units apart. A ball of 1026 vertices keeps all of them with a radius
#   of 1 or 1e-4. With a radius of 2e-6 (4 micrometres across, in metres, the unit of glTF), it loses vertices at different
#   places. All 2048 triangles stay, some of them without area, and nothing is reported. OBJ and STL behave alike.
# Packages: Debian 12: assimp-utils and libassimp5 5.2.5~ds0-1+b1. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
for name in assimp-utils=5.2.5~ds0-1+b1 libassimp5=5.2.5~ds0-1+b1 libminizip1=1.1-8+deb12u1 libdraco7=1.5.5+dfsg-2; do
  apt-get download "$name" >apt.log 2>&1
done
for package in *.deb; do dpkg -x "$package" tree; done
export LD_LIBRARY_PATH="$t/tree/usr/lib/$(uname -m)-linux-gnu"
cat >ball.py <<'P'
import math, struct, sys
radius = float(sys.argv[1])
points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
middles = {}
def middle(a, b):
    key = min(a, b), max(a, b)
    if key not in middles:
        sum_of = [x + y for x, y in zip(points[a], points[b])]
        points.append(tuple(x / math.hypot(*sum_of) for x in sum_of))
        middles[key] = len(points) - 1
    return middles[key]
for _ in range(4):
    finer = []
    for a, b, c in faces:
        x, y, z = middle(a, b), middle(b, c), middle(c, a)
        finer += [(a, x, z), (x, b, y), (z, y, c), (x, y, z)]
    faces = finer
with open('ball.obj', 'w') as obj:
    for p in points: obj.write('v %.9g %.9g %.9g\n' % tuple(radius * x for x in p))
    for f in faces: obj.write('f %d %d %d\n' % tuple(v + 1 for v in f))
with open('ball.stl', 'wb') as stl:
    stl.write(bytes(80) + struct.pack('<I', len(faces)))
    for f in faces: stl.write(struct.pack('<12fH', 0, 0, 0, *(radius * x for v in f for x in points[v]), 0))
P
seen=
for radius in 1 1e-4 2e-6; do
  python3 ball.py "$radius"
  for file in ball.obj ball.stl; do
    tree/usr/bin/assimp info "$file" -jiv >info 2>&1
    vertices=$(awk '/^Vertices/ { print $2 }' info)
    triangles=$(awk '/^Faces/ { print $2 }' info)
    echo "radius $radius, $file: $vertices vertices, $triangles triangles"
    if [ "$vertices" -eq 1026 ]; then all=all; elif [ "$vertices" -lt 1026 ]; then all=fewer; else all=more; fi
    seen="$seen $all/$triangles"
  done
done
want=' all/2048 all/2048 all/2048 all/2048 fewer/2048 fewer/2048'
[ "$seen" = "$want" ] || { echo "changed: $seen"; exit 1; }
