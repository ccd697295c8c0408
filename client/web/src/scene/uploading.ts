// Brings blocks to the graphics processor some at a time, before they are drawn: in one frame with their drawing,
// millions of triangles hold the page up for seconds where software draws.
import { Mesh, MeshBasicMaterial, Scene, WebGLRenderTarget, type BufferGeometry, type Camera, type WebGLRenderer } from 'three';
import { compile } from './compile';
import { placeholder } from './placeholder';

// In one step.
const mostBytes = 2_500_000;

export interface Waiting {
  geometries: readonly BufferGeometry[];
  // It is there and can be drawn.
  onThere: () => void;
}

function bytesOf({ index, attributes }: BufferGeometry): number {
  return [index, ...Object.values(attributes)].reduce((sum, one) => sum + (one?.array.byteLength ?? 0), 0);
}

export class Uploading {
  private waiting: Waiting[] = [];
  private readonly scene = new Scene();
  private readonly material = new MeshBasicMaterial();
  private readonly mesh = new Mesh<BufferGeometry, MeshBasicMaterial>(placeholder(), this.material);
  private readonly target = new WebGLRenderTarget(1, 1);

  constructor(private readonly renderer: WebGLRenderer) {
    this.mesh.frustumCulled = false;
    this.scene.add(this.mesh);
  }

  get isEmpty(): boolean {
    return this.waiting.length === 0;
  }

  add(waiting: Waiting): void {
    this.waiting.push(waiting);
  }

  compile(camera: Camera, signal: AbortSignal, then: () => void): void {
    this.renderer.setRenderTarget(this.target);
    compile(this.renderer, [[this.scene, camera]], signal, then);
    this.renderer.setRenderTarget(null);
  }

  // Brings the next ones.
  step(camera: Camera): void {
    let bytes = 0;
    let count = 0;
    this.renderer.setRenderTarget(this.target);
    for (const { geometries } of this.waiting) {
      if (bytes > mostBytes) break;
      for (const geometry of geometries) this.bring(geometry, camera);
      bytes += geometries.reduce((sum, geometry) => sum + bytesOf(geometry), 0);
      count += 1;
    }
    this.renderer.setRenderTarget(null);
    for (const { onThere } of this.waiting.splice(0, count)) onThere();
  }

  dispose(): void {
    this.waiting = [];
    this.material.dispose();
    this.target.dispose();
  }

  // Drawing one triangle of it into a single pixel takes all of it there.
  private bring(geometry: BufferGeometry, camera: Camera): void {
    const { start, count } = geometry.drawRange;
    geometry.setDrawRange(0, 3);
    this.mesh.geometry = geometry;
    this.renderer.render(this.scene, camera);
    geometry.setDrawRange(start, count);
  }
}
