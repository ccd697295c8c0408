// Paints a preview by WebGL 2: a box whose fragments walk their rays.
import {
  BackSide,
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Data3DTexture,
  DataTexture,
  FloatType,
  GLSL3,
  LinearFilter,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  NearestFilter,
  RawShaderMaterial,
  RedFormat,
  RGFormat,
  Scene,
  PerspectiveCamera,
  WebGLRenderer,
  type IUniform,
  type WebGLRenderTarget,
} from 'three';
import { sumsOf, type Look } from '../volume/looks';
import type { Preview } from '../volume/preview';
import { compile } from './compile';
import {
  crossColour,
  crossOf,
  crossOpacity,
  isSoftwareName,
  placeOfSamples,
  valuesOf,
  type LivePainter,
  type LivePicture,
  type LiveScene,
} from './live_painter';
import { fragmentShader, vertexShader } from './live_shader';
import { sceneFields } from './live_walk';
import { Painting } from './painting';

// The textures and buffers that the shader reads.
interface Drawable {
  preview: Preview;
  samples: Data3DTexture;
  blocks: Data3DTexture;
}

function drawable(preview: Preview): Drawable {
  const samples = new Data3DTexture(preview.samples, ...preview.dims);
  samples.format = RedFormat;
  samples.minFilter = LinearFilter;
  samples.magFilter = LinearFilter;
  const blocks = new Data3DTexture(preview.blocks, ...preview.blockDims);
  blocks.format = RGFormat;
  blocks.minFilter = NearestFilter;
  blocks.magFilter = NearestFilter;
  for (const texture of [samples, blocks]) {
    texture.unpackAlignment = 1;
    texture.needsUpdate = true;
  }
  return { preview, samples, blocks };
}

function letGo({ samples, blocks }: Drawable): void {
  samples.dispose();
  blocks.dispose();
}

interface Tables {
  look: DataTexture | null;
  sums: DataTexture | null;
}

const noTables: Tables = { look: null, sums: null };

function tablesOf(given: Look): Tables {
  const look = new DataTexture(given.table, 256, 1);
  look.minFilter = LinearFilter;
  look.magFilter = LinearFilter;
  const sums = new DataTexture(sumsOf(given), 257, 1, RedFormat, FloatType);
  for (const texture of [look, sums]) texture.needsUpdate = true;
  return { look, sums };
}

export class GlPainter implements LivePainter {
  readonly canvas: HTMLCanvasElement;
  readonly isSoftware: boolean;
  readonly ready: Promise<void>;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly uniforms = Object.fromEntries(
    ['samples', 'blocks', 'look', 'sums', ...sceneFields.map(([name]) => name)].map((name): [string, IUniform<unknown>] => [name, { value: null }]),
  );
  private readonly box: Mesh<BoxGeometry, RawShaderMaterial>;
  private readonly cross = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ color: crossColour, transparent: true, opacity: crossOpacity, depthTest: false }),
  );
  private readonly painting: Painting;
  private readonly known = new Map<Preview, Drawable>();
  private look: Look | null = null;
  private tables = noTables;
  private readonly over = new AbortController();

  // Throws where WebGL 2 is missing.
  constructor(camera: PerspectiveCamera) {
    this.renderer = new WebGLRenderer({ antialias: false, depth: false, alpha: true, powerPreference: 'high-performance' });
    this.painting = new Painting(this.renderer, this.scene, camera);
    this.isSoftware = isSoftware(this.renderer.getContext() as WebGL2RenderingContext);
    this.canvas = this.renderer.domElement;
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader,
      fragmentShader,
      uniforms: this.uniforms,
      side: BackSide,
      depthTest: false,
    });
    this.box = new Mesh(new BoxGeometry(1, 1, 1).translate(0.5, 0.5, 0.5), material);
    this.box.matrixAutoUpdate = false;
    this.box.frustumCulled = false;
    this.cross.frustumCulled = false;
    this.cross.geometry.setAttribute('position', new BufferAttribute(new Float32Array(18), 3));
    this.box.add(this.cross);
    this.scene.add(this.box);
    const shaders: [Scene | Mesh, PerspectiveCamera][] = [
      [this.scene, camera],
      [this.painting.enlarging, camera],
    ];
    this.ready = new Promise((resolve) => compile(this.renderer, shaders, this.over.signal, resolve));
  }

  paint(scene: LiveScene, { wide, high, width, height, bands }: LivePicture, isOver: () => boolean, then: (isWhole: boolean) => void): void {
    if (this.canvas.width !== wide || this.canvas.height !== high) this.renderer.setSize(wide, high, false);
    this.use(scene);
    const edge = (step: number): number => Math.floor((height * step) / bands);
    const begin = (step: number, target: WebGLRenderTarget): void => {
      target.scissorTest = true;
      target.scissor.set(0, edge(step), width, edge(step + 1) - edge(step));
    };
    this.painting.paint({ width, height, isEnlarged: width < wide, steps: bands, begin }, isOver, then);
  }

  keep(previews: ReadonlySet<Preview>): void {
    for (const [preview, made] of this.known) {
      if (previews.has(preview)) continue;
      letGo(made);
      this.known.delete(preview);
    }
  }

  dispose(): void {
    this.over.abort();
    this.keep(new Set());
    this.useLook(null);
    this.box.geometry.dispose();
    this.box.material.dispose();
    this.cross.geometry.dispose();
    this.cross.material.dispose();
    this.painting.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.canvas.remove();
  }

  private use(scene: LiveScene): void {
    const { box, cross } = this;
    const { preview } = scene;
    const made = this.known.get(preview) ?? drawable(preview);
    this.known.set(preview, made);
    if (scene.look !== this.look) this.useLook(scene.look);
    const { samples, blocks } = made;
    for (const [name, value] of Object.entries({ samples, blocks, ...this.tables, ...valuesOf(scene) })) Object.assign(this.uniforms[name] as object, { value });
    box.matrix.copy(placeOfSamples(preview));
    box.matrixWorldNeedsUpdate = true;
    cross.visible = scene.cursor !== null;
    const positions = cross.geometry.getAttribute('position') as BufferAttribute;
    positions.copyArray(crossOf(scene)).needsUpdate = true;
  }

  private useLook(look: Look | null): void {
    this.look = look;
    this.tables.look?.dispose();
    this.tables.sums?.dispose();
    this.tables = look ? tablesOf(look) : noTables;
  }
}

function isSoftware(gl: WebGL2RenderingContext): boolean {
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  return isSoftwareName(String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)));
}
