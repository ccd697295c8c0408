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
  Matrix3,
  Mesh,
  NearestFilter,
  RawShaderMaterial,
  RedFormat,
  RGFormat,
  Scene,
  PerspectiveCamera,
  Vector3,
  WebGLRenderer,
  type WebGLRenderTarget,
} from 'three';
import { sumsOf, type Look } from '../volume/looks';
import { blockSize, type Preview } from '../volume/preview';
import { compile } from './compile';
import {
  crossColour,
  crossOf,
  crossOpacity,
  cropOf,
  isSoftwareName,
  lookingOf,
  placeOfSamples,
  surfaceColour,
  type LivePainter,
  type LivePicture,
  type LiveScene,
} from './live_painter';
import { fragmentShader, vertexShader } from './live_shader';
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

function tablesOf(look: Look): { table: DataTexture; sums: DataTexture } {
  const table = new DataTexture(look.table, 256, 1);
  table.minFilter = LinearFilter;
  table.magFilter = LinearFilter;
  const sums = new DataTexture(sumsOf(look), 257, 1, RedFormat, FloatType);
  for (const texture of [table, sums]) texture.needsUpdate = true;
  return { table, sums };
}

export class GlPainter implements LivePainter {
  readonly name = 'webgl2';
  readonly canvas: HTMLCanvasElement;
  readonly isSoftware: boolean;
  readonly ready: Promise<void>;
  onLost: (() => void) | null = null;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly uniforms = {
    samples: { value: null as Data3DTexture | null },
    blocks: { value: null as Data3DTexture | null },
    blockSize: { value: blockSize },
    dims: { value: new Vector3(2, 2, 2) },
    eye: { value: new Vector3() },
    toNormal: { value: new Matrix3() },
    towardsLight: { value: new Vector3() },
    towardsEye: { value: new Vector3() },
    colour: { value: new Vector3(...surfaceColour) },
    iso: { value: 0.5 },
    reach: { value: 1 },
    isThrough: { value: false },
    isOfLabels: { value: false },
    look: { value: null as DataTexture | null },
    sums: { value: null as DataTexture | null },
    edges: { value: 0 },
    isCropped: { value: false },
    cropLow: { value: new Vector3() },
    cropHigh: { value: new Vector3(1, 1, 1) },
  };
  private readonly box: Mesh<BoxGeometry, RawShaderMaterial>;
  private readonly cross = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ color: crossColour, transparent: true, opacity: crossOpacity, depthTest: false }),
  );
  private readonly painting: Painting;
  private readonly known = new Map<Preview, Drawable>();
  private look: Look | null = null;
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
    this.uniforms.look.value?.dispose();
    this.uniforms.sums.value?.dispose();
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
    const { uniforms, box, cross } = this;
    const { preview, kind } = scene;
    const made = this.known.get(preview) ?? drawable(preview);
    this.known.set(preview, made);
    uniforms.samples.value = made.samples;
    uniforms.blocks.value = made.blocks;
    uniforms.dims.value.set(...preview.dims);
    uniforms.iso.value = scene.iso;
    uniforms.reach.value = scene.reach;
    uniforms.isThrough.value = kind === 'through';
    uniforms.isOfLabels.value = kind === 'labels';
    if (scene.look !== this.look) this.useLook(scene.look);
    uniforms.isCropped.value = scene.crop !== null;
    [uniforms.cropLow.value, uniforms.cropHigh.value] = cropOf(scene);
    box.matrix.copy(placeOfSamples(preview));
    box.matrixWorldNeedsUpdate = true;
    uniforms.toNormal.value.setFromMatrix4(box.matrix).invert().transpose();
    const { eye, towardsEye, towardsLight } = lookingOf(scene);
    uniforms.eye.value = eye;
    uniforms.towardsEye.value = towardsEye;
    uniforms.towardsLight.value = towardsLight;
    cross.visible = scene.cursor !== null;
    const positions = cross.geometry.getAttribute('position') as BufferAttribute;
    positions.copyArray(crossOf(scene)).needsUpdate = true;
  }

  private useLook(look: Look | null): void {
    const { look: table, sums, edges } = this.uniforms;
    this.look = look;
    table.value?.dispose();
    sums.value?.dispose();
    if (look) ({ table: table.value, sums: sums.value } = tablesOf(look));
    edges.value = look?.edges ?? 0;
  }
}

function isSoftware(gl: WebGL2RenderingContext): boolean {
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  return isSoftwareName(String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)));
}
