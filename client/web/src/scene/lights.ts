import { AmbientLight, DirectionalLight, type Camera, type Scene } from 'three';

// One light goes with the camera, so that what is looked at is lit.
export function addLights(scene: Scene, camera: Camera): void {
  const headlight = new DirectionalLight(0xffffff, 2.5);
  headlight.position.set(-0.35, 0.5, 1);
  headlight.target.position.set(0, 0, -1);
  camera.add(headlight, headlight.target);
  scene.add(camera, new AmbientLight(0xffffff, 0.6));
}
