import './dom.mjs';
import vtkXMLPolyDataReader from '@kitware/vtk.js/IO/XML/XMLPolyDataReader.js';
import vtkPolyDataReader from '@kitware/vtk.js/IO/Legacy/PolyDataReader.js';
import vtkSTLReader from '@kitware/vtk.js/IO/Geometry/STLReader.js';
import vtkPLYReader from '@kitware/vtk.js/IO/Geometry/PLYReader.js';
import vtkDracoReader from '@kitware/vtk.js/IO/Geometry/DracoReader.js';
import vtkOBJReader from '@kitware/vtk.js/IO/Misc/OBJReader.js';
import vtkGLTFImporter from '@kitware/vtk.js/IO/Geometry/GLTFImporter.js';
import draco3d from 'draco3d';
import { hex, hexesOfBytes, bytesOf, main, surface } from './report.mjs';

function surfaceOf(poly, more, matrix) {
  const polys = poly.getPolys().getNumberOfCells();
  const normals = Boolean(poly.getPointData().getNormals());
  const labels = poly.getCellData().getArrayByName('label')?.getData();
  const values = poly.getPointData().getArrays().map((array) => array.getName());
  const rgb = poly.getPointData().getArrayByName('RGB')?.getData();
  const told = { normals, labels: labels && [...new Set(labels)].map(Number), colours: rgb && hexesOfBytes(rgb, 3), values, ...more };
  return surface(poly.getPoints().getData(), polys, told, matrix);
}

async function scene(bytes) {
  await vtkDracoReader.setDracoDecoder(draco3d.createDecoderModule);
  const importer = vtkGLTFImporter.newInstance({ renderer: {} });
  await importer.parseAsBinary(bytes.buffer);
  return [...importer.getActors()].map(([name, actor]) => {
    actor.computeMatrix();
    // vtk.js keeps matrices row by row.
    const rows = actor.getMatrix();
    const matrix = Array.from({ length: 16 }, (_, at) => rows[4 * (at % 4) + Math.floor(at / 4)]);
    return surfaceOf(actor.getMapper().getInputData(), { name, colour: hex([...actor.getProperty().getDiffuseColor()]) }, matrix);
  });
}

const kinds = { vtp: vtkXMLPolyDataReader, vtk: vtkPolyDataReader, stl: vtkSTLReader, ply: vtkPLYReader, obj: vtkOBJReader, drc: vtkDracoReader };

await main('@kitware/vtk.js', async (path, suffix) => {
  const bytes = bytesOf(path);
  if (suffix === 'glb') return scene(bytes);
  if (suffix === 'drc') await vtkDracoReader.setDracoDecoder(draco3d.createDecoderModule);
  const reader = kinds[suffix].newInstance(suffix === 'obj' ? { splitMode: 'usemtl' } : {});
  if (suffix === 'obj') reader.parseAsText(new TextDecoder().decode(bytes));
  else if (suffix === 'vtk') reader.parseAsArrayBuffer?.(bytes.buffer) ?? reader.parseAsText(new TextDecoder().decode(bytes));
  else reader.parseAsArrayBuffer(bytes.buffer);
  const found = [];
  for (let at = 0; at < reader.getNumberOfOutputPorts(); at += 1) {
    const poly = reader.getOutputData(at);
    if (poly) found.push(surfaceOf(poly, { name: poly.get('name').name }));
  }
  return found;
});
