// The surface that a volume has at an iso-value, drawn anew for each value and from any side: nothing is extracted.
// Takes as many pixels as there is time for while something moves, and all of them when it rests.
import { Box3, Matrix4, PerspectiveCamera, Vector2, Vector3 } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Vec3 } from '../api/types';
import { firstCrossing, firstLabel, inPreview, type Preview } from '../volume/preview';
import { verticalAngle } from './camera';
import { GlPainter, placeOfSamples, type LivePicture, type LiveScene } from './live_gl';
import type { Look } from '../volume/looks';
import { onTap } from './tap';
import { firstOffset, fitted, turned } from './views';

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

  private readonly controls: OrbitControls;
  private readonly resizing: ResizeObserver;
  private cursor: Vector3 | null = null;
  private iso = NaN;
  private isBelow = false;
  private look: Look | null = null;
  private isOfLabels = false;
  private crop: readonly [Vector3, Vector3] | null = null;
  // Software draws the first, coarser one while something moves.
  private first: Preview | null = null;
  private best: Preview | null = null;
  private readonly over = new AbortController();
  // Whether the shaders are there.
  private isCompiled = false;
  private isBusy = false;
  private changedAt = 0;
  private isMoving = false;
  private settling = 0;
  // Milliseconds a pixel, of the last frames of each kind; guessed before the first.
  private readonly costs: { moving: number; resting: number };

  private readonly camera = new PerspectiveCamera(verticalAngle, 1, 1, 1000);
  private readonly painter = new GlPainter(this.camera);

  // Throws if the browser has no WebGL 2.
  constructor(private readonly host: HTMLElement) {
    this.isSoftware = this.painter.isSoftware;
    const guess = this.isSoftware ? 4e-3 : 1e-5;
    this.costs = { moving: guess, resting: 2 * guess };
    this.canvas = this.painter.canvas;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    host.prepend(this.canvas);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => this.moved());
    onTap(this.canvas, (event) => this.tapped(event));
    this.canvas.addEventListener('webglcontextrestored', () => this.changed());
    this.resizing = new ResizeObserver(() => this.changed());
    this.resizing.observe(host);
    void this.painter.ready.then(() => {
      this.isCompiled = true;
      this.changed();
    });
  }

  private get isDisposed(): boolean {
    return this.over.signal.aborted;
  }

  // The first one is looked at as a whole; another one of the same volume leaves the camera where it is.
  setPreview(preview: Preview): void {
    const isFirst = this.first === null;
    // Samples of another window begin anew, and so do labels, which have none: their NaN equals nothing.
    const { first } = this;
    if (!first || preview.window.some((end, at) => end !== first.window[at])) this.first = preview;
    this.best = preview;
    this.painter.keep(new Set([this.first ?? preview, preview]));
    if (isFirst) this.fit(firstOffset);
    this.changed();
  }

  // Where the slices meet, in millimetres.
  setCursor(cursor: Vec3): void {
    const next = new Vector3(...cursor);
    if (this.cursor?.equals(next)) return;
    this.cursor = next;
    this.changed();
  }

  // In the volume's units, of a preview of values. Lower values are inside if it is below.
  setIso(iso: number, isBelow: boolean): void {
    if (this.iso === iso && this.isBelow === isBelow) return;
    this.iso = iso;
    this.isBelow = isBelow;
    this.moved();
  }

  // What of the volume is drawn, as parts of its samples along each axis; null for all of it.
  setCrop(box: readonly [Vec3, Vec3] | null): void {
    const next = box && ([new Vector3(...box[0]), new Vector3(...box[1])] as const);
    if (JSON.stringify(next) === JSON.stringify(this.crop)) return;
    this.crop = next;
    this.changed();
  }

  // The preview is one of labels, with these colours.
  setLabels(table: Uint8Array): void {
    const whole = new Uint8Array(4 * 256);
    whole.set(table.subarray(0, whole.length));
    this.use({ table: whole, edges: 0 }, true);
  }

  // Null: the surface at the iso-value.
  setLook(look: Look | null): void {
    this.use(look, false);
  }

  private use(look: Look | null, isOfLabels: boolean): void {
    if ((this.look !== null) !== (look !== null)) {
      const factor = look ? costOfLook : 1 / costOfLook;
      for (const kind of ['moving', 'resting'] as const) this.costs[kind] *= factor;
    }
    this.look = look;
    this.isOfLabels = isOfLabels;
    this.changed();
  }

  fit(offset: Vec3): void {
    if (!this.best) return;
    const last = new Vector3(...this.best.dims).subScalar(1);
    const { min, max } = new Box3(new Vector3(), last).applyMatrix4(placeOfSamples(this.best));
    const { clientWidth: width, clientHeight: height } = this.host;
    const angle = (verticalAngle * Math.PI) / 180;
    const place = fitted([min.toArray(), max.toArray()], offset, angle, width / Math.max(1, height));
    this.controls.target.set(...place.target);
    this.stand(place.offset);
  }

  // Around the patient's axis and up, in radians; and nearer by a factor below 1.
  turn(azimuth: number, elevation: number, factor = 1): void {
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    this.stand(turned(offset.toArray(), azimuth, elevation));
  }

  private stand(offset: Vec3): void {
    this.camera.position.copy(this.controls.target).add(new Vector3(...offset));
    this.controls.update();
    this.moved();
  }

  dispose(): void {
    this.over.abort();
    clearTimeout(this.settling);
    this.resizing.disconnect();
    this.controls.dispose();
    this.painter.dispose();
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
    const isRough = this.isSoftware && !isResting;
    const scene = this.sceneOf(isRough ? this.first : this.best, isRough ? 1 : 0.5);
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [wide, high] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
    const scale = this.scaleFor(wide * high, kind);
    const [width, height] = [Math.max(1, Math.round(wide * scale)), Math.max(1, Math.round(high * scale))];
    this.camera.aspect = clientWidth / clientHeight;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = distance / 1000;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    const began = performance.now();
    const { iso } = this;
    const isOver = (): boolean => this.isDisposed || this.changedAt !== 0;
    const picture: LivePicture = { wide, high, width, height, bands: this.bandsFor(width * height, kind) };
    this.painter.paint(scene, picture, isOver, (isWhole) => {
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

  private sceneOf(preview: Preview, reach: number): LiveScene {
    const { camera, look, crop, cursor, isBelow } = this;
    const kind = look === null ? 'surface' : this.isOfLabels ? 'labels' : 'through';
    return { preview, camera, target: this.controls.target, iso: inPreview(preview, this.iso), isBelow, reach, kind, look, crop, cursor };
  }

  private bandsFor(pixels: number, kind: 'moving' | 'resting'): number {
    return kind === 'resting' ? Math.max(1, Math.min(mostBands, Math.ceil((this.costs.resting * pixels) / bandTime))) : 1;
  }

  private scaleFor(pixels: number, kind: 'moving' | 'resting'): number {
    const time = kind === 'resting' ? restingTime : this.isSoftware ? movingTimeOfSoftware : movingTime;
    return scales.find((scale) => this.costs[kind] * pixels * scale * scale <= time) ?? (scales.at(-1) as number);
  }

  private tapped(event: PointerEvent): void {
    if (!this.best || !this.onPick) return;
    const preview = this.best;
    const bounds = this.canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - bounds.left)) / bounds.width - 1;
    const y = 1 - (2 * (event.clientY - bounds.top)) / bounds.height;
    const toSamples = new Matrix4().copy(placeOfSamples(preview)).invert();
    const from = this.camera.position.clone().applyMatrix4(toSamples);
    const through = new Vector3(...new Vector2(x, y).toArray(), 0.5).unproject(this.camera).applyMatrix4(toSamples);
    const ray = [from.toArray(), through.sub(from).toArray()] as const;
    const { look, isOfLabels } = this;
    const place = look && isOfLabels ? firstLabel(preview, look.table, ...ray) : firstCrossing(preview, inPreview(preview, this.iso), ...ray);
    if (place) this.onPick(place);
  }
}
