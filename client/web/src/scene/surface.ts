// A surface in a canvas: blocks of triangles that come one by one, a camera, and what is drawn over them. Draws when something changed.
import { type Object3D, PerspectiveCamera, Scene, WebGLRenderer } from 'three';
import type { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Vec3, Volume, Label } from '../api/types';
import type { Block } from '../mesh/blocks';
import type { Part } from '../mesh/glb';
import { OrientationCube } from './cube';
import { compile, whenDrawn } from './compile';
import { Components } from './components';
import { Cross } from './cross';
import { Cut } from './cut';
import { efforts, FrameBudget } from './budget';
import { addLights, clipTo, controlsOf, facing, heightOf, panned, placeOf, verticalAngle } from './camera';
import { CoarseMaker } from './coarse_maker';
import type { Reach } from './distances';
import { Frame, screenRatio, type Manner } from './frame';
import { joinSeams } from './joining';
import { Parts } from './parts';
import { pickedAt, type Picked } from './picked';
import { captionScale, pictureOf } from './picture';
import { Rulers } from './rulers';
import type { SurfaceStyle } from './style';
import { Uploading } from './uploading';
import { onTap } from './tap';
import { firstOffset, fitted, turned, unitBox, viewOffsets, type CameraPlace, type ViewName } from './views';

const settleDelay = 180;

export class Surface {
  readonly canvas: HTMLCanvasElement;
  readonly rulers: Rulers;
  readonly cut: Cut;
  readonly components: Components;
  private readonly cross: Cross;
  private readonly budget = new FrameBudget();
  onCamera: (() => void) | null = null;
  // A frame shows more blocks.
  onShown: (() => void) | null = null;
  // How many triangles of its finest blocks the last frame shows.
  trianglesShown = 0;
  // A click or tap; null where nothing is.
  onPick: ((picked: Picked | null) => void) | null = null;

  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(verticalAngle, 1, 1, 1000);
  private readonly controls: OrbitControls;
  // Its letters take the browser a while.
  private cube: OrientationCube | null = null;
  private readonly uploading: Uploading;
  private readonly frame: Frame;
  private readonly parts: Parts;
  // A level for each number of triangles that a frame may have.
  private readonly copies: CoarseMaker;
  private readonly levels = [...new Set(efforts.map(({ triangles }) => triangles))];
  private readonly resizing: ResizeObserver;
  private bounds = unitBox;
  private scheduled = 0;
  private settling = 0;
  private isMoving = false;
  private isCoarse = false;
  private readonly over = new AbortController();
  // While the graphics processor has something to do; and whether a frame waits for its end.
  private isBusy = false;
  private isWaiting = false;
  // Whether the frame that is to be drawn waited for the one before.
  private wasWaiting = false;
  // Whether the shaders are there; one that is made anew ends the wait for those before.
  private isCompiled = false;
  private compiling = new AbortController();
  // Blocks came that the last frame does not show.
  private isStale = false;
  private onAllShown: (() => void)[] = [];

  constructor(private readonly host: HTMLElement) {
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true, powerPreference: 'high-performance' });
    this.uploading = new Uploading(this.renderer);
    this.parts = new Parts(this.scene, this.uploading, () => this.draw());
    this.copies = new CoarseMaker(this.levels, (levels) => {
      this.parts.takeCopies(levels);
      if (this.isCoarse) this.draw();
    });
    this.components = new Components(this.scene, this.parts, this.copies);
    this.frame = new Frame(this.renderer, this.scene, this.camera, this.parts);
    this.renderer.localClippingEnabled = true;
    this.renderer.autoClear = false;
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    host.prepend(this.canvas);

    this.camera.up.set(0, 0, 1);
    addLights(this.scene, this.camera);
    this.rulers = new Rulers(this.scene, host, '#17a398');
    this.cut = new Cut(this.scene);
    this.cross = new Cross(this.scene);

    this.controls = controlsOf(this.camera, this.canvas, { start: () => this.beginMove(), end: () => this.endMove(), change: () => this.cameraChanged() });
    onTap(this.canvas, (event) => this.tapped(event));
    this.canvas.addEventListener('webglcontextrestored', () => this.draw());

    this.resizing = new ResizeObserver(() => this.resize());
    this.resizing.observe(host);
    this.resize();
    this.moveTo({ offset: firstOffset, target: [0, 0, 0] });
    setTimeout(() => this.prepare());
  }

  // A task after the one in which the canvas is made, which takes its time.
  private prepare(): void {
    if (this.isDisposed) return;
    this.cube = new OrientationCube();
    this.compile();
  }

  // Nothing is drawn until what it is drawn with is there.
  private compile(): void {
    if (!this.cube || this.isDisposed) return;
    this.compiling.abort();
    const compiling = new AbortController();
    this.compiling = compiling;
    this.isCompiled = false;
    const { scene, cube, camera, frame } = this;
    const scenes: [Object3D, PerspectiveCamera][] = [[scene, camera], [cube.scene, cube.camera], [frame.painting.enlarging, camera]];
    compile(this.renderer, scenes, compiling.signal, () => {
      this.uploading.compile(this.camera, compiling.signal, () => {
        this.isCompiled = true;
        this.draw();
        this.bring();
      });
    });
  }

  // The corners of what is shown, known before its first block.
  setBounds(bounds: [Vec3, Vec3]): void {
    this.bounds = bounds;
    this.fit(firstOffset);
  }

  addBlocks(blocks: Block[], part: Part | null, isCoarse = false): void {
    if (this.parts.add(blocks, part, isCoarse)) this.compile();
    if (!isCoarse) for (const block of blocks) this.copies.add(this.parts.numberOf(part?.label ?? null), block);
    delete this.host.dataset.still;
    this.bring();
  }

  // Some blocks at a time, with a frame when drawing has left time for one.
  private bring(): void {
    if (this.uploading.isEmpty || this.isBusy || this.isDisposed || !this.isCompiled) return;
    this.isBusy = true;
    this.isStale = true;
    this.uploading.step(this.camera);
    whenDrawn(this.renderer.getContext() as WebGL2RenderingContext, () => this.release(() => this.budget.soon(() => this.draw())));
  }

  // Ends a task; the next drawing has waited for it.
  private release(then: () => void): void {
    this.isBusy = false;
    if (this.isDisposed) return;
    this.wasWaiting = this.isWaiting;
    then();
    if (this.isWaiting) this.draw();
    else this.bring();
  }

  // To be called once the last block is drawn: from then on the shading has no edges at the seams.
  finish(): void {
    this.parts.finish();
    this.copies.finish();
    joinSeams(this.parts, this.over.signal, () => this.draw());
  }

  // Resolves once all blocks that were added are drawn.
  allShown(): Promise<void> {
    return new Promise((resolve) => {
      this.onAllShown.push(resolve);
      this.draw();
    });
  }

  setStyle(style: SurfaceStyle): void {
    this.changed(this.parts.setStyle(style));
  }

  // How far its vertices are from the surface as it was extracted; null where the file does not say.
  reach(): Reach | null {
    return this.parts.reach();
  }

  // The distance that has the last colour, in millimetres.
  setDistanceTop(millimetres: number): void {
    this.parts.setDistanceTop(millimetres);
    this.draw();
  }

  // What is seen below a pointer; null where nothing is, and while it moves.
  below({ clientX, clientY }: { clientX: number; clientY: number }): Picked | null {
    const { left, top } = this.canvas.getBoundingClientRect();
    return this.isMoving ? null : this.pickedAt(clientX - left, clientY - top);
  }

  setCut(isCut: boolean): void {
    this.changed(this.parts.setCut(isCut ? [this.cut.plane] : null));
  }

  // Turns the camera so that the cut is seen, where it is seen edge-on or from the side that stays.
  faceCut(): void {
    this.moveTo(facing(this.place, this.cut.plane.normal.toArray()));
  }

  // Lines through that sample, along the volume's axes.
  setCross(volume: Volume, cursor: Vec3 | null): void {
    this.cross.place(volume, cursor);
    this.draw();
  }

  // Marks those places, and looks from outside at the first of them.
  mark(places: readonly Vec3[]): void {
    const outwards = this.rulers.marks.show(places, this.bounds);
    if (places.length > 0) this.fit(outwards ?? undefined);
  }

  // Changes what is drawn, by a coarse copy first where frames take long.
  change(what: () => void): void {
    this.beginMove();
    what();
    this.draw();
    this.endMove();
  }

  // Other blocks in place of those that are there.
  replace(all: readonly { blocks: Block[]; part: Part | null }[]): void {
    this.components.mark(null);
    this.parts.clear();
    this.copies.restart([]);
    for (const { blocks, part } of all) this.addBlocks(blocks, part);
    this.finish();
  }

  setHidden(labels: ReadonlySet<Label>): void {
    this.parts.setHidden(labels);
    this.draw();
  }

  setColour(label: Label, colour: string): void {
    this.parts.setColour(label, colour);
    this.draw();
  }

  // Of one label beside others; times the opacity of all.
  setOpacity(label: Label, opacity: number): void {
    this.changed(this.parts.setOpacity(label, opacity));
  }

  private changed(hasOtherShader: boolean): void {
    if (hasOtherShader) this.compile();
    this.draw();
  }

  fit(offset: Vec3 = this.place.offset): void {
    this.moveTo(fitted(this.bounds, offset, (verticalAngle * Math.PI) / 180, this.camera.aspect));
  }

  look(view: ViewName): void {
    this.fit(viewOffsets[view]);
  }

  private get isDisposed(): boolean {
    return this.over.signal.aborted;
  }

  get place(): CameraPlace {
    return placeOf(this.camera, this.controls);
  }

  // Moves the camera without telling onCamera: for linked cameras.
  follow(place: CameraPlace): void {
    const tell = this.onCamera;
    this.onCamera = null;
    this.moveTo(place);
    this.onCamera = tell;
  }

  moveTo({ offset, target }: CameraPlace): void {
    this.controls.target.set(...target);
    this.camera.position.set(target[0] + offset[0], target[1] + offset[1], target[2] + offset[2]);
    this.controls.update();
    this.cameraChanged();
  }

  turn(azimuth: number, elevation: number): void {
    this.nudge({ ...this.place, offset: turned(this.place.offset, azimuth, elevation) });
  }

  zoom(factor: number): void {
    this.nudge({ ...this.place, offset: this.place.offset.map((value) => value * factor) as Vec3 });
  }

  // Both in parts of the view's height.
  pan(right: number, up: number): void {
    this.nudge(panned(this.camera, this.place, right, up));
  }

  // Asks for a frame.
  draw(): void {
    if (this.scheduled !== 0 || this.isDisposed) return;
    delete this.host.dataset.still;
    this.isWaiting = this.isBusy;
    if (this.isBusy || !this.isCompiled) return;
    this.scheduled = requestAnimationFrame(() => {
      this.scheduled = 0;
      if (this.isBusy) this.isWaiting = true;
      else if (this.isCompiled) this.render();
    });
  }

  // The view, with two pixels for each of the page's; beside the texts of the distances' colours.
  picture(distances: readonly string[]): Promise<Blob> {
    this.setCoarse(false);
    this.render({ steps: 1, sharpness: 2 / screenRatio() });
    const captions = { scale: captionScale(this.canvas, this.host.clientHeight), seen: heightOf(this.place), distances };
    this.draw();
    return pictureOf(this.canvas, captions, (context) => this.rulers.paintLabels(context, this.camera, captions.scale));
  }

  dispose(): void {
    this.over.abort();
    this.compiling.abort();
    cancelAnimationFrame(this.scheduled);
    clearTimeout(this.settling);
    this.resizing.disconnect();
    const { controls, parts, components, copies, uploading, rulers, cut, cross, cube, renderer } = this;
    for (const one of [controls, components, parts, copies, uploading, this.frame.painting, rulers, cut, cross, cube, renderer]) one?.dispose();
    // The browser keeps only some contexts; it must not wait for garbage to be collected.
    this.renderer.forceContextLoss();
    this.canvas.remove();
  }

  // In one step it is drawn at once.
  private get manner(): Manner {
    if (this.isCoarse) return { steps: 1, sharpness: this.budget.effort.sharpness };
    return { steps: this.isMoving || this.parts.isSeenThrough ? 1 : this.budget.steps, sharpness: 1 };
  }

  private render(manner = this.manner): void {
    if (this.isDisposed) return;
    this.isStale = false;
    const began = performance.now();
    const { isCoarse } = this;
    const there = this.parts.trianglesThere;
    const isNext = this.wasWaiting;
    this.wasWaiting = false;
    const { clientWidth: width, clientHeight: height } = this.host;
    const after = (): void => {
      this.cube?.render(this.renderer, this.camera, height);
      this.rulers.placeLabels(this.camera, width, height);
    };
    this.isBusy = true;
    const isOver = (): boolean => this.isDisposed || this.isWaiting;
    this.frame.paint(manner, isOver, after, (isWhole) => {
      // Before the next one begins.
      if (isWhole && !this.isDisposed) this.budget.drawn({ began, isMoving: this.isMoving, isCoarse, isNext });
      this.release(() => isWhole && this.drawn(there));
    });
  }

  private drawn(triangles: number): void {
    const { isMoving, budget } = this;
    if (!this.isCoarse) this.trianglesShown = triangles;
    this.onShown?.();
    if (budget.isSlow) this.copies.want();
    if (isMoving && budget.isSlow) this.setCoarse(true);
    if (this.isCoarse) this.parts.setLevel(this.levels.indexOf(budget.effort.triangles));
    // For measurements.
    if (isMoving) budget.note(this.host.dataset, this.isCoarse ? this.parts.trianglesMoving : null);
    if (this.uploading.isEmpty && !this.isStale) for (const resolve of this.onAllShown.splice(0)) resolve();
    this.noteStill();
  }

  // What is seen is all of it, and nothing is to be drawn any more.
  private noteStill(): void {
    const isToDraw = !this.isCompiled || this.scheduled !== 0 || this.isWaiting || this.isBusy || this.isStale || !this.uploading.isEmpty;
    if (!this.isMoving && !this.isCoarse && !isToDraw) this.host.dataset.still = '';
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.scheduled !== 0) cancelAnimationFrame(this.scheduled);
    this.scheduled = 0;
    // At once: a canvas of another size is blank.
    if (!this.isCompiled) return;
    // A surface that takes long stays coarse until the size is the last one.
    this.beginMove();
    this.render({ ...this.manner, steps: 1 });
    this.endMove();
  }

  private cameraChanged(): void {
    clipTo(this.camera, this.controls.target, this.bounds);
    this.draw();
    this.onCamera?.();
  }

  private nudge(place: CameraPlace): void {
    this.change(() => this.moveTo(place));
  }

  private beginMove(): void {
    clearTimeout(this.settling);
    if (!this.isMoving) this.budget.begin();
    this.isMoving = true;
    if (this.budget.isSlow) this.setCoarse(true);
  }

  private endMove(): void {
    clearTimeout(this.settling);
    this.settling = window.setTimeout(() => {
      this.isMoving = false;
      this.setCoarse(false);
      // Where frames are quick nothing was coarse, and the last frame is the final one.
      this.noteStill();
    }, settleDelay);
  }

  private setCoarse(isCoarse: boolean): void {
    if (isCoarse === this.isCoarse) return;
    this.parts.setCoarse((this.isCoarse = isCoarse));
    if (isCoarse) this.copies.want();
    this.draw();
  }

  private tapped(event: PointerEvent): void {
    const { left, top, height } = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    const face = this.cube?.faceAt(x, y, height);
    if (face) this.look(face);
    else this.onPick?.(this.pickedAt(x, y));
  }

  // The nearest point of the surface, or of the slice on its cut, that is seen there, in pixels from the upper left corner.
  private pickedAt(x: number, y: number): Picked | null {
    this.setCoarse(false);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return pickedAt((2 * x) / width - 1, 1 - (2 * y) / height, this.camera, this.parts, this.cut);
  }
}
