// Reads a file with three.js in Chromium, for readers.test.ts.
import { Box3, Color, Group, Mesh } from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { ThreeMFLoader } from 'three/addons/loaders/3MFLoader.js';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { OBJLoader } from 'three/addons/loaders/OBJLoader.js';
import { PLYLoader } from 'three/addons/loaders/PLYLoader.js';
import { STLLoader } from 'three/addons/loaders/STLLoader.js';

const draco = new DRACOLoader().setDecoderPath('/node_modules/three/examples/jsm/libs/draco/');
const gltf = new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder);
const loaders = { glb: gltf, drc: draco, '3mf': new ThreeMFLoader(), obj: new OBJLoader(), ply: new PLYLoader(), stl: new STLLoader() };

globalThis.read = async (url) => {
  const loaded = await loaders[url.slice(url.lastIndexOf('.') + 1)].loadAsync(url);
  const root = new Group().add(loaded.scene ?? (loaded.isBufferGeometry ? new Mesh(loaded) : loaded));
  root.updateMatrixWorld(true);
  const meshes = [];
  root.traverse((object) => {
    if (!object.isMesh) return;
    const { index, attributes } = object.geometry;
    const color = attributes.color ? new Color().fromBufferAttribute(attributes.color, 0) : object.material.color;
    const { name } = object.userData.name || object.name ? object : object.parent;
    meshes.push({
      name: object.userData.name ?? name,
      colour: color.getHexString(),
      triangles: (index ?? attributes.position).count / 3,
    });
  });
  const { min, max } = new Box3().setFromObject(root, true);
  return { meshes, bounds: [min.toArray(), max.toArray()] };
};
