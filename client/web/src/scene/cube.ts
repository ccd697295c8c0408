// The cube in the corner that says which way the patient lies; its faces can be clicked.
import {
  BoxGeometry,
  CanvasTexture,
  Mesh,
  MeshBasicMaterial,
  PerspectiveCamera,
  Raycaster,
  Scene,
  SRGBColorSpace,
  Vector2,
  type Camera,
  type WebGLRenderer,
} from 'three';
import type { ViewName } from './views';

// The order of a box's materials: +x -x +y -y +z -z.
const faces: readonly ViewName[] = ['L', 'R', 'P', 'A', 'S', 'I'];
// In degrees clockwise, from the box's own texture directions to letters that stand upright.
const faceTurns: Record<ViewName, number> = { L: -90, R: 90, P: 180, A: 0, S: 180, I: 180 };
const texturePixels = 128;
const largest = 92;
const margin = 10;

function faceTexture(name: ViewName): CanvasTexture {
  const canvas = document.createElement('canvas');
  canvas.width = texturePixels;
  canvas.height = texturePixels;
  const context = canvas.getContext('2d');
  if (context) {
    context.fillStyle = '#eef2f4';
    context.fillRect(0, 0, texturePixels, texturePixels);
    context.strokeStyle = '#8b989f';
    context.lineWidth = 6;
    context.strokeRect(3, 3, texturePixels - 6, texturePixels - 6);
    context.translate(texturePixels / 2, texturePixels / 2);
    context.rotate((faceTurns[name] * Math.PI) / 180);
    context.fillStyle = '#1f2a30';
    context.font = '600 72px system-ui, sans-serif';
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.fillText(name, 0, 5);
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return texture;
}

function sizeIn(height: number): number {
  return Math.min(largest, height / 5);
}

export class OrientationCube {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(28, 1, 0.1, 10);
  private readonly box: Mesh<BoxGeometry, MeshBasicMaterial[]>;
  private readonly ray = new Raycaster();

  constructor() {
    const materials = faces.map((name) => new MeshBasicMaterial({ map: faceTexture(name) }));
    this.box = new Mesh(new BoxGeometry(1, 1, 1), materials);
    this.scene.add(this.box);
    this.camera.up.set(0, 0, 1);
  }

  // Draws in the lower left corner over what is there; the height is the canvas's, in pixels.
  render(renderer: WebGLRenderer, looker: Camera, height: number): void {
    const pixels = sizeIn(height);
    this.camera.quaternion.copy(looker.quaternion);
    this.camera.position.set(0, 0, 1).applyQuaternion(looker.quaternion).multiplyScalar(3.9);
    renderer.setScissorTest(true);
    renderer.setViewport(margin, margin, pixels, pixels);
    renderer.setScissor(margin, margin, pixels, pixels);
    renderer.clearDepth();
    renderer.render(this.scene, this.camera);
    renderer.setScissorTest(false);
  }

  // The face at a point of the canvas, in pixels from its upper left corner.
  faceAt(x: number, y: number, height: number): ViewName | null {
    const u = (x - margin) / sizeIn(height);
    const v = (height - y - margin) / sizeIn(height);
    if (u < 0 || u > 1 || v < 0 || v > 1) return null;
    this.camera.updateMatrixWorld();
    this.ray.setFromCamera(new Vector2(2 * u - 1, 2 * v - 1), this.camera);
    const [hit] = this.ray.intersectObject(this.box);
    return (hit?.face && faces[hit.face.materialIndex]) ?? null;
  }

  dispose(): void {
    this.box.geometry.dispose();
    for (const material of this.box.material) {
      material.map?.dispose();
      material.dispose();
    }
  }
}
