// The surface that a volume has at an iso-value, drawn anew for each value and from any side: nothing is extracted.
// Takes as many pixels as there is time for while something moves, and all of them when it rests.
import {
  BackSide,
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  type Data3DTexture,
  type DataTexture,
  GLSL3,
  LineBasicMaterial,
  LineSegments,
  Matrix3,
  Matrix4,
  Mesh,
  PerspectiveCamera,
  RawShaderMaterial,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
  type WebGLRenderTarget,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Vec3 } from '../api/types';
import { blockSize, firstCrossing, firstLabel, inPreview, type Preview } from '../volume/preview';
import { verticalAngle } from './camera';
import { compile } from './compile';
import { drawable, letGo, tablesOf, type Drawable } from './live_textures';
import type { Look } from '../volume/looks';
import { fragmentShader, vertexShader } from './live_shader';
import { Painting, type Picture } from './painting';
import { onTap } from './tap';
import { firstOffset, fitted } from './views';

// How long a frame may take while something moves, and at rest, in milliseconds. A change in the middle of a frame is
// drawn after it, so that half a frame's time comes on top.
const movingTime = 33;
const movingTimeOfSoftware = 50;
const restingTime = 1500;
// A picture at rest is drawn in bands that take so long; a change ends it after the band that is being drawn.
const bandTime = 50;
const mostBands = 64;
const settleDelay = 220;
// How much longer a look through the volume takes than its surface, guessed for the first frame.
const costOfLook = 3;
// Parts of the canvas's width and height.
const scales = [1, 0.7, 0.5, 0.35, 0.25, 0.18];

export interface Frame {
  // From the change to the finished picture, in milliseconds.
  took: number;
  scale: number;
  isResting: boolean;
  // The iso-value of the surface that it shows.
  iso: number;
}

export class LiveSurface {
  readonly canvas: HTMLCanvasElement;
  // Software draws: coarser volumes do.
  readonly isSoftware: boolean;
  onFrame: ((frame: Frame) => void) | null = null;
  // A click or tap on the surface, in samples of the preview.
  onPick: ((place: Vec3) => void) | null = null;

  private readonly renderer: WebGLRenderer;
  private readonly gl: WebGL2RenderingContext;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(verticalAngle, 1, 1, 1000);
  private readonly controls: OrbitControls;
  private readonly resizing: ResizeObserver;
  private readonly uniforms = {
    samples: { value: null as Data3DTexture | null },
    blocks: { value: null as Data3DTexture | null },
    blockSize: { value: blockSize },
    dims: { value: new Vector3(2, 2, 2) },
    eye: { value: new Vector3() },
    toNormal: { value: new Matrix3() },
    towardsLight: { value: new Vector3() },
    towardsEye: { value: new Vector3() },
    colour: { value: new Vector3(0.86, 0.84, 0.78) },
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
  // Through where the slices meet, over the surface.
  private readonly cross = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ color: '#2ce0cb', transparent: true, opacity: 0.45, depthTest: false }),
  );
  private cursor: Vec3 | null = null;
  private iso = NaN;
  private labelTable = new Uint8Array(0);
  private crop: readonly [Vec3, Vec3] | null = null;
  private readonly painting: Painting;
  // Software draws the first, coarser one while something moves.
  private first: Drawable | null = null;
  private best: Drawable | null = null;
  private readonly over = new AbortController();
  // Whether the shaders are there.
  private isCompiled = false;
  private isBusy = false;
  private changedAt = 0;
  private isMoving = false;
  private settling = 0;
  // Milliseconds a pixel, of the last frames of each kind; guessed before the first.
  private readonly costs: { moving: number; resting: number };

  // Throws where WebGL 2 is missing.
  constructor(private readonly host: HTMLElement) {
    this.renderer = new WebGLRenderer({ antialias: false, depth: false, alpha: true, powerPreference: 'high-performance' });
    this.gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.painting = new Painting(this.renderer, this.scene, this.camera);
    this.isSoftware = isSoftware(this.gl);
    const guess = this.isSoftware ? 4e-3 : 1e-5;
    this.costs = { moving: guess, resting: 2 * guess };
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    host.prepend(this.canvas);
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
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => this.moved());
    onTap(this.canvas, (event) => this.tapped(event));
    this.canvas.addEventListener('webglcontextrestored', () => this.changed());
    this.resizing = new ResizeObserver(() => this.changed());
    this.resizing.observe(host);
    const shaders: [Scene | Mesh, PerspectiveCamera][] = [
      [this.scene, this.camera],
      [this.painting.enlarging, this.camera],
    ];
    compile(this.renderer, shaders, this.over.signal, () => {
      this.isCompiled = true;
      this.changed();
    });
  }

  private get isDisposed(): boolean {
    return this.over.signal.aborted;
  }

  // The first one is looked at as a whole; another one of the same volume leaves the camera where it is.
  setPreview(preview: Preview): void {
    const made = drawable(preview);
    const isFirst = this.first === null;
    // Of another window, or in place of the one before.
    const isOther = this.first?.preview.window.join() !== preview.window.join();
    if (isOther) for (const old of new Set([this.first, this.best])) if (old) letGo(old);
    if (isOther) this.first = made;
    else if (this.best && this.best !== this.first) letGo(this.best);
    this.best = made;
    this.use(made);
    if (isFirst) this.fit(firstOffset);
    this.changed();
  }

  private use({ preview, samples, blocks }: Drawable): void {
    this.uniforms.samples.value = samples;
    this.uniforms.blocks.value = blocks;
    this.uniforms.dims.value.set(...preview.dims);
    this.uniforms.iso.value = inPreview(preview, this.iso);
    const [x, y, z] = preview.steps;
    const [ox, oy, oz] = preview.origin;
    this.box.matrix.set(x[0], y[0], z[0], ox, x[1], y[1], z[1], oy, x[2], y[2], z[2], oz, 0, 0, 0, 1);
    this.box.matrixWorldNeedsUpdate = true;
    this.uniforms.toNormal.value.setFromMatrix4(this.box.matrix).invert().transpose();
    this.placeCross();
    this.placeCrop();
  }

  // Where the slices meet, in millimetres.
  setCursor(cursor: Vec3): void {
    if (this.cursor?.join() === cursor.join()) return;
    this.cursor = cursor;
    this.placeCross();
    this.changed();
  }

  private placeCross(): void {
    this.cross.visible = this.cursor !== null;
    if (!this.cursor) return;
    const place = new Vector3(...this.cursor).applyMatrix4(new Matrix4().copy(this.box.matrix).invert());
    const positions = this.cross.geometry.getAttribute('position');
    for (const axis of [0, 1, 2]) {
      for (const end of [0, 1]) {
        const point = place.clone().setComponent(axis, end * (this.uniforms.dims.value.getComponent(axis) - 1));
        positions.setXYZ(2 * axis + end, ...point.toArray());
      }
    }
    positions.needsUpdate = true;
  }

  // In the volume's units, of a preview of values.
  setIso(iso: number): void {
    if (this.iso === iso) return;
    this.iso = iso;
    this.moved();
  }

  // What of the volume is drawn, as parts of its samples along each axis; null for all of it.
  setCrop(box: readonly [Vec3, Vec3] | null): void {
    if (JSON.stringify(box) === JSON.stringify(this.crop)) return;
    this.crop = box;
    this.changed();
  }

  // In samples of what is drawn now, of which a copy may have fewer.
  private placeCrop(): void {
    const { cropLow, cropHigh, dims, isCropped } = this.uniforms;
    const last = dims.value.clone().subScalar(1);
    isCropped.value = this.crop !== null;
    cropLow.value.set(...(this.crop?.[0] ?? [0, 0, 0])).multiply(last);
    cropHigh.value.set(...(this.crop?.[1] ?? [1, 1, 1])).multiply(last);
  }

  // The preview is one of labels, with these colours.
  setLabels(table: Uint8Array): void {
    const whole = new Uint8Array(4 * 256);
    whole.set(table.subarray(0, whole.length));
    this.setLook({ table: whole, edges: 0 });
    this.uniforms.isOfLabels.value = true;
    this.labelTable = whole;
  }

  // Null: the surface at the iso-value.
  setLook(look: Look | null): void {
    const { isThrough, isOfLabels, look: table, sums, edges } = this.uniforms;
    isOfLabels.value = false;
    if (isThrough.value !== (look !== null)) {
      const factor = look ? costOfLook : 1 / costOfLook;
      for (const kind of ['moving', 'resting'] as const) this.costs[kind] *= factor;
    }
    isThrough.value = look !== null;
    if (look) {
      table.value?.dispose();
      sums.value?.dispose();
      ({ table: table.value, sums: sums.value } = tablesOf(look));
      edges.value = look.edges;
    }
    this.changed();
  }

  fit(offset: Vec3): void {
    if (!this.best) return;
    const corners = this.corners();
    const low = corners[0].clone().min(corners[1]);
    const high = corners[0].clone().max(corners[1]);
    const { clientWidth: width, clientHeight: height } = this.host;
    const angle = (verticalAngle * Math.PI) / 180;
    const place = fitted([low.toArray(), high.toArray()], offset, angle, width / Math.max(1, height));
    this.controls.target.set(...place.target);
    this.camera.position.copy(this.controls.target).add(new Vector3(...place.offset));
    this.controls.update();
    this.moved();
  }

  // Around the patient's axis and up, in radians; and nearer by a factor below 1.
  turn(azimuth: number, elevation: number, factor = 1): void {
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    const up = new Vector3(0, 0, 1);
    offset.applyAxisAngle(up, azimuth);
    const side = offset.clone().cross(up).normalize();
    const limit = 0.02;
    const wanted = Math.max(limit, Math.min(Math.PI - limit, offset.angleTo(up) - elevation));
    offset.applyAxisAngle(side, offset.angleTo(up) - wanted);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.moved();
  }

  dispose(): void {
    this.over.abort();
    clearTimeout(this.settling);
    this.resizing.disconnect();
    this.controls.dispose();
    for (const old of new Set([this.first, this.best])) if (old) letGo(old);
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

  // Two opposite corners of the box around the whole volume.
  private corners(): [Vector3, Vector3] {
    const low = new Vector3(Infinity, Infinity, Infinity);
    const high = low.clone().negate();
    const { x, y, z } = this.uniforms.dims.value;
    for (let corner = 0; corner < 8; corner += 1) {
      const place = new Vector3(corner & 1 ? x - 1 : 0, corner & 2 ? y - 1 : 0, corner & 4 ? z - 1 : 0);
      place.applyMatrix4(this.box.matrix);
      low.min(place);
      high.max(place);
    }
    return [low, high];
  }

  private moved(): void {
    this.isMoving = true;
    clearTimeout(this.settling);
    this.settling = window.setTimeout(() => {
      this.isMoving = false;
      this.changed();
    }, settleDelay);
    this.changed();
  }

  private changed(): void {
    delete this.host.dataset.still;
    if (this.changedAt === 0) this.changedAt = performance.now();
    // What changes while a frame is drawn is drawn next.
    if (this.isBusy || this.isDisposed || !this.isCompiled) return;
    this.isBusy = true;
    requestAnimationFrame(() => this.render());
  }

  private render(): void {
    const { clientWidth, clientHeight } = this.host;
    if (this.isDisposed || !this.first || !this.best || clientWidth === 0 || clientHeight === 0) {
      this.isBusy = false;
      return;
    }
    const isResting = !this.isMoving;
    const changedAt = this.changedAt;
    this.changedAt = 0;
    const kind = isResting ? 'resting' : 'moving';
    this.use(this.isSoftware && !isResting ? this.first : this.best);
    this.uniforms.reach.value = this.isSoftware && !isResting ? 1 : 0.5;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [wide, high] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
    if (this.canvas.width !== wide || this.canvas.height !== high) this.renderer.setSize(wide, high, false);
    const scale = this.scaleFor(wide * high, kind);
    const [width, height] = [Math.max(1, Math.round(wide * scale)), Math.max(1, Math.round(high * scale))];
    this.camera.aspect = clientWidth / clientHeight;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = distance / 1000;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    this.uniforms.eye.value.copy(this.camera.position).applyMatrix4(new Matrix4().copy(this.box.matrix).invert());
    this.uniforms.towardsEye.value.copy(this.camera.position).sub(this.controls.target).normalize();
    this.uniforms.towardsLight.value.set(-0.35, 0.5, 1).transformDirection(this.camera.matrixWorld);
    const began = performance.now();
    const { iso } = this;
    const isOver = (): boolean => this.isDisposed || this.changedAt !== 0;
    this.painting.paint(this.inBands(width, height, kind), isOver, (isWhole) => {
      const now = performance.now();
      this.isBusy = false;
      if (this.isDisposed) return;
      if (isWhole) {
        this.costs[kind] = 0.5 * this.costs[kind] + (0.5 * (now - began)) / (width * height);
        this.onFrame?.({ took: now - changedAt, scale, isResting, iso });
      }
      if (this.changedAt !== 0) this.changed();
      // There was time for more.
      else if (isResting && this.scaleFor(wide * high, kind) > scale) this.changed();
      else if (isResting) this.host.dataset.still = '';
    });
  }

  private inBands(width: number, height: number, kind: 'moving' | 'resting'): Picture {
    const steps = kind === 'resting' ? Math.max(1, Math.min(mostBands, Math.ceil((this.costs.resting * width * height) / bandTime))) : 1;
    const edge = (step: number): number => Math.floor((height * step) / steps);
    const begin = (step: number, target: WebGLRenderTarget): void => {
      target.scissorTest = true;
      target.scissor.set(0, edge(step), width, edge(step + 1) - edge(step));
    };
    return { width, height, isEnlarged: width < this.canvas.width, steps, begin };
  }

  private scaleFor(pixels: number, kind: 'moving' | 'resting'): number {
    const time = kind === 'resting' ? restingTime : this.isSoftware ? movingTimeOfSoftware : movingTime;
    return scales.find((scale) => this.costs[kind] * pixels * scale * scale <= time) ?? (scales.at(-1) as number);
  }

  private tapped(event: PointerEvent): void {
    if (!this.best || !this.onPick) return;
    this.use(this.best);
    const bounds = this.canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - bounds.left)) / bounds.width - 1;
    const y = 1 - (2 * (event.clientY - bounds.top)) / bounds.height;
    const toSamples = new Matrix4().copy(this.box.matrix).invert();
    const from = this.camera.position.clone().applyMatrix4(toSamples);
    const through = new Vector3(...new Vector2(x, y).toArray(), 0.5).unproject(this.camera).applyMatrix4(toSamples);
    const { isOfLabels, iso } = this.uniforms;
    const ray = [from.toArray(), through.sub(from).toArray()] as const;
    const { preview } = this.best;
    const place = isOfLabels.value ? firstLabel(preview, this.labelTable, ...ray) : firstCrossing(preview, iso.value, ...ray);
    if (place) this.onPick(place);
  }
}

function isSoftware(gl: WebGL2RenderingContext): boolean {
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
