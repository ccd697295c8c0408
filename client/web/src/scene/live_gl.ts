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
  Matrix4,
  Mesh,
  NearestFilter,
  RawShaderMaterial,
  RedFormat,
  RGFormat,
  Scene,
  Vector3,
  type PerspectiveCamera,
  WebGLRenderer,
  type IUniform,
  type WebGLRenderTarget,
} from 'three';
import { sumsOf, type Look } from '../volume/looks';
import { blockSize, type Preview } from '../volume/preview';
import { compile } from './compile';
import { fragmentShader, kinds, vertexShader } from './live_shader';
import { Painting } from './painting';

export interface LiveScene {
  preview: Preview;
  camera: PerspectiveCamera;
  // The point that the camera looks at, in millimetres.
  target: Vector3;
  // In parts of the preview's window.
  iso: number;
  // True if lower values are inside.
  isBelow: boolean;
  // The length of a step, in samples; a longer one may pass over what is thinner.
  reach: number;
  // The surface at the iso-value, a look through the samples, or labels by the look's colours.
  kind: keyof typeof kinds;
  look: Look | null;
  // The part of the volume that is drawn, in parts of its samples along each axis; null for all of it.
  crop: readonly [Vector3, Vector3] | null;
  // The point where the slices meet, in millimetres; lines through it are drawn over the surface.
  cursor: Vector3 | null;
}

// In pixels of the screen.
export interface LivePicture {
  // The size of the canvas.
  wide: number;
  high: number;
  // The size of what is painted, which is enlarged to the canvas.
  width: number;
  height: number;
  // It is painted in so many, and a change ends it after one of them.
  bands: number;
}

// The colour of the surface, and of the lines over it with their opacity.
const surfaceColour = new Vector3(0.86, 0.84, 0.78);
const crossColour = '#2ce0cb';
const crossOpacity = 0.45;

// The places of the preview's samples in the patient.
export function placeOfSamples({ steps: [x, y, z], origin: [ox, oy, oz] }: Preview): Matrix4 {
  return new Matrix4().set(x[0], y[0], z[0], ox, x[1], y[1], z[1], oy, x[2], y[2], z[2], oz, 0, 0, 0, 1);
}

// Six points, in samples: the ends of three lines through the cursor.
function crossOf({ preview, cursor }: LiveScene): Float32Array<ArrayBuffer> {
  const points = new Float32Array(18);
  if (!cursor) return points;
  const place = cursor.clone().applyMatrix4(placeOfSamples(preview).invert());
  for (const axis of [0, 1, 2] as const) {
    for (const end of [0, 1]) {
      place.clone().setComponent(axis, end * (preview.dims[axis] - 1)).toArray(points, 3 * (2 * axis + end));
    }
  }
  return points;
}

// The scene as the shader takes it: places in samples, directions as unit vectors in millimetres.
function valuesOf({ preview, camera, target, iso, isBelow, reach, kind, look, crop }: LiveScene): Record<string, number | Vector3 | Matrix4> {
  const ofSamples = placeOfSamples(preview);
  const dims = new Vector3(...preview.dims);
  const last = dims.clone().subScalar(1);
  const [low, high] = crop ?? [new Vector3(0, 0, 0), new Vector3(1, 1, 1)];
  return {
    toNormal: ofSamples.clone().setPosition(0, 0, 0).invert().transpose(),
    eye: camera.position.clone().applyMatrix4(ofSamples.clone().invert()),
    iso,
    towardsLight: new Vector3(-0.35, 0.5, 1).transformDirection(camera.matrixWorld),
    reach,
    towardsEye: camera.position.clone().sub(target).normalize(),
    edges: look?.edges ?? 0,
    colour: surfaceColour,
    kind: kinds[kind],
    cropLow: low.clone().multiply(last),
    isCropped: crop ? 1 : 0,
    isBelow: isBelow ? 1 : 0,
    cropHigh: high.clone().multiply(last),
    blockSize,
    dims,
  };
}

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

export class GlPainter {
  readonly canvas: HTMLCanvasElement;
  // Software draws.
  readonly isSoftware: boolean;
  // All that it paints with is there.
  readonly ready: Promise<void>;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly uniforms = Object.fromEntries(
    [...fragmentShader.matchAll(/^uniform \w+ (\w+);$/gm)].map(([, name = '']): [string, IUniform<unknown>] => [name, { value: null }]),
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

  // Calls back with true when it is on the canvas, with false if `isOver` ended it.
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

  // Keeps what it has of these previews, and lets go the others.
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
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
