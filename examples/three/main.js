// Uploads a volume, receives its surface as GLB in the same request, and shows it with three.js.
//
// The server must allow this page's origin: isomeshd --cors-origin http://localhost:8000
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const server = new URLSearchParams(location.search).get('server') ?? 'http://127.0.0.1:8080';
const form = document.querySelector('form');
const output = document.querySelector('output');
const canvas = document.querySelector('canvas');

const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(40, 1, 0.001, 10);
const controls = new OrbitControls(camera, canvas);
scene.background = new THREE.Color(0x202428);
scene.add(new THREE.HemisphereLight(0xffffff, 0x404040, 1.5));
const lamp = new THREE.DirectionalLight(0xffffff, 1.5);
camera.add(lamp);
scene.add(camera);

// The surface is compressed with Draco. three.js decodes it in workers.
const draco = new DRACOLoader();
draco.setDecoderPath('./node_modules/three/examples/jsm/libs/draco/gltf/');
const loader = new GLTFLoader();
loader.setDRACOLoader(draco);

let surface;

// POST /v1/mesh takes the volume as its body. The response is the mesh, or a problem object.
async function meshOf(file, iso) {
  const query = new URLSearchParams({ iso, format: 'glb' });
  const answer = await fetch(`${server}/v1/mesh?${query}`, { method: 'POST', body: file });
  if (!answer.ok) {
    const problem = await answer.json();
    throw new Error(problem.detail ?? problem.title);
  }
  return answer.arrayBuffer();
}

async function show(glb) {
  const gltf = await loader.parseAsync(glb, '');
  if (surface) scene.remove(surface);
  surface = gltf.scene; // in metres, Y is up, the patient looks towards +Z
  scene.add(surface);
  const box = new THREE.Box3().setFromObject(surface);
  const size = box.getSize(new THREE.Vector3());
  box.getCenter(controls.target);
  camera.position.copy(controls.target).add(new THREE.Vector3(0, 0, 2 * size.length()));
  controls.update();
  let triangles = 0;
  surface.traverse(({ geometry }) => {
    if (geometry) triangles += geometry.index.count / 3;
  });
  const millimetres = size.toArray().map((metres) => Math.round(1000 * metres));
  return `${triangles} triangles, ${millimetres.join(' x ')} mm`;
}

form.addEventListener('submit', async (event) => {
  event.preventDefault();
  const { file, iso } = form.elements;
  output.textContent = 'Making the surface ...';
  try {
    output.textContent = await show(await meshOf(file.files[0], iso.value));
  } catch (error) {
    output.textContent = error.message;
  }
});

renderer.setAnimationLoop(() => {
  const { clientWidth: width, clientHeight: height } = canvas;
  renderer.setSize(width, height, false);
  camera.aspect = width / Math.max(1, height);
  camera.updateProjectionMatrix();
  controls.update();
  renderer.render(scene, camera);
});
