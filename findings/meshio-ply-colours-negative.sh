#!/bin/sh
# Guess: a vertex of the colour 204 51 17 (`property uchar`) has these numbers in meshio, whether the PLY is text or binary.
# Seen: as text it has. Of the binary file, `uchar` is read as a signed byte: 204 becomes -52, and the array is int8. The same file with
#   the type's other name, `uint8`, is right. Most programs, such as VTK, MeshLab and Blender, write `uchar`.
# Packages: Debian 12: python3-meshio 7.0.0-3 (meshio 5.0.0), python3-numpy 1:1.24.2-1+deb12u1. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download python3-meshio=7.0.0-3 python3-numpy=1:1.24.2-1+deb12u1 libblas3=3.11.0-2 liblapack3=3.11.0-2 libgfortran5=12.2.0-14+deb12u1 \
  libquadmath0=12.2.0-14+deb12u1 python3-rich=13.3.1-1 >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
cat >read.py <<'P'
import struct
import meshio

points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
colour = (204, 51, 17)

def header(kind, name):
    colours = ''.join(f'property {name} {channel}\n' for channel in ('red', 'green', 'blue'))
    return (f'ply\nformat {kind} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{colours}'
            'element face 1\nproperty list uchar int vertex_indices\nend_header\n').encode()

rows = '\n'.join(' '.join(map(str, point + colour)) for point in points).encode()
packed = b''.join(struct.pack('<3f3B', *point, *colour) for point in points)
files = {
    'text, uchar': header('ascii', 'uchar') + rows + b'\n3 0 1 2\n',
    'binary, uchar': header('binary_little_endian', 'uchar') + packed + struct.pack('<B3i', 3, 0, 1, 2),
    'binary, uint8': header('binary_little_endian', 'uint8') + packed + struct.pack('<B3i', 3, 0, 1, 2),
}
for name, data in files.items():
    with open('a.ply', 'wb') as file:
        file.write(data)
    mesh = meshio.read('a.ply')
    print(f'{name}:', *(int(mesh.point_data[channel][0]) for channel in ('red', 'green', 'blue')))
P
libraries=$(find tree/usr/lib -name 'lib*.so.*' -exec dirname {} + | sort -u | sed "s|^|$t/|" | paste -sd:)
seen=$(LD_LIBRARY_PATH=$libraries PYTHONPATH=tree/usr/lib/python3/dist-packages /usr/bin/python3 -S -W ignore read.py)
echo "$seen"
[ "$seen" = 'text, uchar: 204 51 17
binary, uchar: -52 51 17
binary, uint8: 204 51 17' ] || { echo changed; exit 1; }
