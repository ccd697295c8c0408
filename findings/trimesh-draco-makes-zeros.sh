#!/bin/sh
# Guess: trimesh rejects a GLB that requires an extension it cannot decode, as the specification of glTF asks ("extensionsRequired").
# Seen: without a word it makes a mesh of a Draco GLB with the right numbers of vertices and triangles, whose coordinates and indices are all
#   0. Accessors of compressed primitives have no bufferView, and those are zeros where nothing is compressed. An uncompressed GLB is right.
# Packages: Debian 13: python3-trimesh 4.5.1-3, with Debian 12's Python; npm @gltf-transform/core and /extensions 4.5.1, draco3d 1.5.9.
#   Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @gltf-transform/core@4.5.1 @gltf-transform/extensions@4.5.1 \
  draco3d@1.5.9 >npm.log 2>&1
mkdir -p state/lists/partial cache/archives/partial
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | head -n 1)
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror trixie main" >sources
set -- -o Dir::Etc::SourceList="$t/sources" -o Dir::Etc::SourceParts=- -o Dir::State="$t/state" -o Dir::Cache="$t/cache" \
  -o Acquire::Languages=none -o APT::Sandbox::User=root
apt-get "$@" update >apt.log 2>&1
apt-get "$@" download python3-trimesh=4.5.1-3 >>apt.log 2>&1
apt-get download python3-numpy=1:1.24.2-1+deb12u1 libblas3=3.11.0-2 liblapack3=3.11.0-2 libgfortran5=12.2.0-14+deb12u1 \
  libquadmath0=12.2.0-14+deb12u1 python3-networkx=2.8.8-1 >>apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
cat >write.mjs <<'M'
import { Document, NodeIO } from '@gltf-transform/core';
import { KHRDracoMeshCompression } from '@gltf-transform/extensions';
import draco3d from 'draco3d';
const document = new Document();
const buffer = document.createBuffer();
const accessor = (type, array) => document.createAccessor().setType(type).setArray(array).setBuffer(buffer);
const primitive = document.createPrimitive()
  .setAttribute('POSITION', accessor('VEC3', new Float32Array([1, 2, 3, 2, 2, 3, 1, 4, 3, 1, 2, 6])))
  .setIndices(accessor('SCALAR', new Uint16Array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])));
document.createScene().addChild(document.createNode().setMesh(document.createMesh().addPrimitive(primitive)));
const io = new NodeIO().registerExtensions([KHRDracoMeshCompression]);
io.registerDependencies({ 'draco3d.encoder': await draco3d.createEncoderModule() });
await io.write('plain.glb', document);
document.createExtension(KHRDracoMeshCompression).setRequired(true);
await io.write('draco.glb', document);
M
node write.mjs >node.log 2>&1
cat >read.py <<'P'
import trimesh
for name in 'plain', 'draco':
    (mesh,) = trimesh.load(name + '.glb', process=False).geometry.values()
    print(f'{name}: {len(mesh.vertices)} vertices, {len(mesh.faces)} triangles, to {mesh.vertices.max(axis=0)}, last index {mesh.faces.max()}')
P
libraries=$(find tree/usr/lib -name 'lib*.so.*' -exec dirname {} + | sort -u | sed "s|^|$t/|" | paste -sd:)
seen=$(LD_LIBRARY_PATH=$libraries PYTHONPATH=tree/usr/lib/python3/dist-packages /usr/bin/python3 -W ignore read.py)
echo "$seen"
[ "$seen" = 'plain: 4 vertices, 4 triangles, to [2. 4. 6.], last index 3
draco: 4 vertices, 4 triangles, to [0. 0. 0.], last index 0' ] || { echo changed; exit 1; }
