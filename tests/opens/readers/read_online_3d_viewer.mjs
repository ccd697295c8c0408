import './dom.mjs';
import draco3d from 'draco3d';
import { existsSync } from 'node:fs';
import { basename } from 'node:path';
import { bytesOf, hex, main, surface } from './report.mjs';

await main('online-3d-viewer', async (path) => {
  // It asks for the decoder by a script element.
  globalThis.DracoDecoderModule = draco3d.createDecoderModule;
  globalThis.document.head.appendChild = (script) => script.onload();
  const OV = await import('online-3d-viewer');
  const importer = new OV.Importer();
  for (const name of [path, path.replace(/obj$/, 'mtl')]) {
    if (name !== path && (!name.endsWith('.mtl') || !existsSync(name))) continue;
    const file = new OV.ImporterFile(basename(name), OV.FileSource.Decompressed, null);
    file.SetContent(bytesOf(name).buffer);
    importer.GetFileList().AddFile(file);
  }
  const model = await new Promise((resolve, reject) => {
    importer.ImportLoadedFiles(new OV.ImportSettings(), {
      onImportSuccess: (result) => resolve(result.model),
      onImportError: (error) => reject(new Error(error.message ?? `code ${error.code}`)),
    });
  });
  const surfaces = [];
  model.EnumerateTransformedMeshInstances((mesh) => {
    const points = Array.from({ length: mesh.VertexCount() }, (_, at) => mesh.GetVertex(at)).flatMap(({ x, y, z }) => [x, y, z]);
    const hexOf = ({ r, g, b }) => hex([r / 255, g / 255, b / 255]);
    const colours = Array.from({ length: mesh.VertexColorCount() }, (_, at) => hexOf(mesh.GetVertexColor(at)));
    const colour = hexOf(model.GetMaterial(mesh.GetTriangle(0).mat).color);
    const more = { name: mesh.GetName(), colour, colours: [...new Set(colours)], normals: mesh.NormalCount() > 0 };
    surfaces.push(surface(points, mesh.TriangleCount(), more));
  });
  return surfaces;
});
