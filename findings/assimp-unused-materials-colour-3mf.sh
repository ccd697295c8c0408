#!/bin/sh
# Guess: materials of a 3MF file (basematerials) that no object refers to change nothing. Objects that refer to a colour group
#   (m:colorgroup of the materials extension) get its colours, or none from a reader that does not know the extension.
# Seen: assimp shows such objects in its default grey. If the file also has a basematerials group that no object refers to, it shows
#   all of them in the first colour of that group, without a warning: a green object becomes red.
# Packages: Debian 12: assimp-utils and libassimp5 5.2.5~ds0-1+b1. (5.4.3 of Debian 13 reads the colour groups as colours of the
#   vertices, but takes "#RRGGBB" for transparent.) Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
for name in assimp-utils=5.2.5~ds0-1+b1 libassimp5=5.2.5~ds0-1+b1 libminizip1=1.1-8+deb12u1 libdraco7=1.5.5+dfsg-2; do
  apt-get download "$name" >apt.log 2>&1
done
for package in *.deb; do dpkg -x "$package" tree; done
export LD_LIBRARY_PATH="$t/tree/usr/lib/$(uname -m)-linux-gnu"
cat >make.py <<'P'
import zipfile
def tetrahedron(id, group):
    return (f'<object id="{id}" type="model" pid="{group}" pindex="0"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
            '<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>'
            '<triangle v1="0" v2="1" v3="3"/><triangle v1="0" v2="3" v3="2"/><triangle v1="1" v2="2" v3="3"/></triangles></mesh></object>')
def write(name, more):
    with zipfile.ZipFile(name, 'w') as file:
        file.writestr('[Content_Types].xml', '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
            '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>')
        file.writestr('_rels/.rels', '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="a" '
            'Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>')
        file.writestr('3D/3dmodel.model', '<?xml version="1.0" encoding="UTF-8"?><model unit="millimeter" '
            'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" '
            'xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"><resources>' + more +
            '<m:colorgroup id="2"><m:color color="#0000FFFF"/></m:colorgroup><m:colorgroup id="3"><m:color color="#00FF00FF"/></m:colorgroup>' +
            tetrahedron(4, 2) + tetrahedron(5, 3) + '</resources><build><item objectid="4"/><item objectid="5"/></build></model>')
write('groups.3mf', '')
write('unused.3mf', '<basematerials id="1"><base name="unused" displaycolor="#FF0000FF"/></basematerials>')
P
python3 make.py
seen=
for name in groups unused; do
  tree/usr/bin/assimp export "$name.3mf" "$name.obj" >log 2>&1
  colours=$(awk '/^usemtl/ { used[++n] = $2 } /^newmtl/ { name = $2 } /^Kd/ { colour[name] = $2 " " $3 " " $4 }
                 END { for (i = 1; i <= n; ++i) printf("%s(%s)", (i > 1 ? " " : ""), colour[used[i]]) }' "$name.mtl" "$name.obj")
  echo "$name: $colours"
  seen="$seen|$colours"
done
grey='(0.600000024 0.600000024 0.600000024)'
[ "$seen" = "|$grey $grey|(1 0 0) (1 0 0)" ] || { echo "changed"; exit 1; }
