import './dom.mjs';
import { existsSync, readFileSync } from 'node:fs';
import { DRACOLoader } from 'three/examples/jsm/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { MTLLoader } from 'three/examples/jsm/loaders/MTLLoader.js';
import { OBJLoader } from 'three/examples/jsm/loaders/OBJLoader.js';
import { PLYLoader } from 'three/examples/jsm/loaders/PLYLoader.js';
import { STLLoader } from 'three/examples/jsm/loaders/STLLoader.js';
import { ThreeMFLoader } from 'three/examples/jsm/loaders/3MFLoader.js';
import { USDLoader } from 'three/examples/jsm/loaders/USDLoader.js';
import { VTKLoader } from 'three/examples/jsm/loaders/VTKLoader.js';
import { MeshoptDecoder } from 'three/examples/jsm/libs/meshopt_decoder.module.js';
import { Group, Mesh } from 'three';
import { bytesOf, hexOfLinear, main, surface } from './report.mjs';

const draco = new DRACOLoader();

const readers = {
  glb: async (bytes) => {
    const loader = new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder);
    return (await loader.parseAsync(bytes.buffer, '')).scene;
  },
  drc: (bytes) => new Promise((resolve, reject) => draco.parse(bytes.buffer, resolve, reject)),
  stl: (bytes) => new STLLoader().parse(bytes.buffer),
  ply: (bytes) => new PLYLoader().parse(bytes.buffer),
  vtk: (bytes) => new VTKLoader().parse(bytes.buffer),
  vtp: (bytes) => new VTKLoader().parse(bytes.buffer),
  '3mf': (bytes) => new ThreeMFLoader().parse(bytes.buffer),
  usda: (bytes) => new USDLoader().parse(new TextDecoder().decode(bytes)),
  usdz: (bytes) => new USDLoader().parse(bytes.buffer),
  obj: (bytes, path) => {
    const loader = new OBJLoader();
    const library = path.replace(/obj$/, 'mtl');
    if (existsSync(library)) loader.setMaterials(new MTLLoader().parse(readFileSync(library, 'utf8'), ''));
    return loader.parse(new TextDecoder().decode(bytes));
  },
};

function nameOf(object) {
  const own = object.userData.name ?? object.name;
  return object.parent?.userData.name && (own === '' || /_\d+$/.test(own)) ? object.parent.userData.name : own || object.parent?.name;
}

function hexesOf(color) {
  const all = Array.from({ length: color.count }, (_, at) => hexOfLinear([color.getX(at), color.getY(at), color.getZ(at)]));
  return [...new Set(all)];
}

function surfaceOf(mesh) {
  const { index, attributes } = mesh.geometry;
  const position = attributes.position;
  const points = new Float32Array(3 * position.count);
  for (let at = 0; at < position.count; at += 1) points.set([position.getX(at), position.getY(at), position.getZ(at)], 3 * at);
  const material = Array.isArray(mesh.material) ? mesh.material[0] : mesh.material;
  const colours = attributes.color && hexesOf(attributes.color);
  const values = Object.keys(attributes).filter((key) => !['position', 'normal', 'color', 'uv'].includes(key));
  return surface(
    points,
    (index?.count ?? position.count) / 3,
    { name: nameOf(mesh), colour: `#${material.color.getHexString()}`, colours, normals: 'normal' in attributes, values },
    mesh.matrixWorld.elements,
  );
}

await main('three', async (path, suffix) => {
  const read = await readers[suffix](bytesOf(path), path);
  const root = new Group().add(read.isBufferGeometry ? new Mesh(read) : read);
  root.updateMatrixWorld(true);
  const surfaces = [];
  root.traverse((object) => {
    if (object.isMesh) surfaces.push(surfaceOf(object));
  });
  return surfaces;
});
