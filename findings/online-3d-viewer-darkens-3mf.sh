#!/bin/sh
# Guess: a 3MF material of the display colour #CC3311 is #cc3311 in Online 3D Viewer, as the same colour is from an OBJ with its MTL.
# Seen: the OBJ's is #cc3311. The 3MF's is #520100, a dark brown: the colour is converted from sRGB to linear light twice, by the loader of
#   three.js and once more behind it. White and black stay, so a grey model shows nothing of it but its shade: #808080 becomes #0a0a0a.
# Packages: npm online-3d-viewer 0.18.0, linkedom 0.18.15 and fflate 0.8.2. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save online-3d-viewer@0.18.0 linkedom@0.18.15 fflate@0.8.2 >npm.log 2>&1
cat >read.mjs <<'M'
import { DOMParser, parseHTML } from 'linkedom';
import { strToU8, zipSync } from 'fflate';
Object.assign(globalThis, { window: globalThis, document: parseHTML('<html></html>').document, DOMParser, ProgressEvent: class extends Event {} });
const OV = await import('online-3d-viewer');
const core = 'http://schemas.microsoft.com/3dmanufacturing/core/2015/02';
const relations = 'http://schemas.openxmlformats.org/package/2006/relationships';
const faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
const model = (colour) => `<model unit="millimeter" xmlns="${core}"><resources>
  <basematerials id="1"><base name="m" displaycolor="${colour}"/></basematerials>
  <object id="2" type="model" pid="1" pindex="0"><mesh><vertices>
    <vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles>
    ${faces.map(([a, b, c]) => `<triangle v1="${a}" v2="${b}" v3="${c}"/>`).join('')}</triangles></mesh></object>
  </resources><build><item objectid="2"/></build></model>`;
const archive = (colour) => zipSync({
  '[Content_Types].xml': strToU8('<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"/>'),
  '_rels/.rels': strToU8(`<Relationships xmlns="${relations}"><Relationship Id="r" Target="/3D/a.model" Type="${core}/3dmodel"/></Relationships>`),
  '3D/a.model': strToU8(model(colour)),
});
const obj = `mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl m\n${faces.map((f) => `f ${f.map((v) => v + 1).join(' ')}`).join('\n')}`;
const mtl = (colour) => `newmtl m\nKd ${[1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255).join(' ')}`;
async function colourOf(files) {
  const importer = new OV.Importer();
  for (const [name, bytes] of Object.entries(files)) {
    const file = new OV.ImporterFile(name, OV.FileSource.Decompressed, null);
    file.SetContent(Uint8Array.from(bytes).buffer);
    importer.GetFileList().AddFile(file);
  }
  const { model } = await new Promise((onImportSuccess, onImportError) =>
    importer.ImportLoadedFiles(new OV.ImportSettings(), { onImportSuccess, onImportError }));
  const { r, g, b } = model.GetMaterial(0).color;
  return `#${[r, g, b].map((v) => v.toString(16).padStart(2, '0')).join('')}`;
}
for (const colour of ['#CC3311', '#808080']) {
  const [text, packed] = [{ 'a.obj': strToU8(obj), 'a.mtl': strToU8(mtl(colour)) }, { 'a.3mf': archive(colour) }];
  console.log(`${colour}: OBJ ${await colourOf(text)}, 3MF ${await colourOf(packed)}`);
}
M
seen=$(node read.mjs | grep OBJ)
echo "$seen"
[ "$seen" = '#CC3311: OBJ #cc3311, 3MF #520100
#808080: OBJ #808080, 3MF #0a0a0a' ] || { echo changed; exit 1; }
