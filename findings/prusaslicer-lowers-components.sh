#!/bin/sh
# Guess: components of one 3MF object keep their places relative to one another in PrusaSlicer, because the file has one build item: one
#   object with two parts. The standard says that a build item is what is printed, and that components are the parts of an object.
# Seen: PrusaSlicer makes an object of each component and lowers each to the bed on its own. A cube that begins 10 mm above another one
#   begins at the same height in the exported STL, without a warning. --no-ensure-on-bed keeps the places. Two build items behave alike.
# Packages: Debian 12: prusa-slicer 2.5.0+dfsg-4, with the libraries below that read and compute. Its window asks whether the objects are one with
#   several parts; 2.9.2 of Debian 13 does the same. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
pinned='prusa-slicer=2.5.0+dfsg-4 libexpat1=2.5.0-1+deb12u5 libopenvdb10.0=10.0.1-2 libblosc1=1.21.3+ds-1 libtbb12=2021.8.0-2+deb12u1
  libnlopt0=2.7.1-5 libimath-3-1-29=3.1.6-1 libmpfr6=4.2.0-1 libgmp10=2:6.2.1+dfsg1-1.1'
for library in log filesystem locale thread regex chrono iostreams; do pinned="$pinned libboost-$library""1.74.0=1.74.0+ds1-21"; done
# The libraries of its window that this machine lacks, of any version. Their names have no blanks.
others=$(apt-get install --simulate --no-install-recommends $pinned | sed -n 's/^Inst \(lib[^ ]*\) .*/\1/p')
for name in $others; do case " $pinned " in *" $name="*) ;; *) pinned="$pinned $name" ;; esac; done
apt-get download $pinned >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
machine="$(uname -m)-linux-gnu"
export LD_LIBRARY_PATH="$t/tree/usr/lib/$machine:$t/tree/lib/$machine"
python3 - <<'P'
import zipfile
def cube(id, x, z):
    points = [(x + a, b, z + c) for c in (0, 10) for b in (0, 10) for a in (0, 10)]
    faces = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)]
    return (f'<object id="{id}" type="model"><mesh><vertices>' + ''.join('<vertex x="%d" y="%d" z="%d"/>' % p for p in points) +
            '</vertices><triangles>' + ''.join('<triangle v1="%d" v2="%d" v3="%d"/>' % f for f in faces) + '</triangles></mesh></object>')
def write(name, more, items):
    with zipfile.ZipFile(name, 'w') as file:
        file.writestr('[Content_Types].xml', '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
            '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>')
        file.writestr('_rels/.rels', '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="a" '
            'Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>')
        file.writestr('3D/3dmodel.model', '<?xml version="1.0" encoding="UTF-8"?><model unit="millimeter" '
            'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>' + cube(1, 0, 0) + cube(2, 10, 10) + more +
            '</resources><build>' + items + '</build></model>')
write('components.3mf', '<object id="3" type="model"><components><component objectid="1"/><component objectid="2"/></components></object>',
      '<item objectid="3"/>')
write('items.3mf', '', '<item objectid="1"/><item objectid="2"/>')
P
cat >heights.py <<'P'
import struct
data, heights = open('out.stl', 'rb').read(), {}
for at in range(84, len(data), 50):
    corners = [struct.unpack_from('<3f', data, at + 12 * corner) for corner in (1, 2, 3)]
    heights.setdefault(sum(p[0] for p in corners) > 30, []).extend(p[2] for p in corners)
print('the lower cube begins at %.0f mm, the upper one at %.0f mm' % (min(heights[False]), min(heights[True])))
P
seen=
for run in 'components' 'items' 'components --no-ensure-on-bed'; do
  set -- $run
  tree/usr/bin/prusa-slicer --datadir "$t/data" --export-stl ${2:-} --output out.stl "$1.3mf" >log 2>&1
  heights=$(python3 heights.py)
  echo "$run: $heights"
  seen="$seen|$heights"
done
low='the lower cube begins at 0 mm, the upper one at'
[ "$seen" = "|$low 0 mm|$low 0 mm|$low 10 mm" ] || { echo "changed"; exit 1; }
