// One plane at any angle through the point where the slices meet: a pane of its own, and a line with a handle in the slices.
import type { Axis, Vec3, Volume } from '../../api/types';
import { h } from '../../ui/dom';
import { imageOf, paintImage } from '../../ui/pixels';
import { Signal, type Scope } from '../../ui/signal';
import { WheelSteps } from '../../ui/wheel';
import { axisDirection, cross, opposite, pictureAxes, sampleAt, sideOf, toPatient, toSamples } from '../../volume/geometry';
import { lineIn, obliqueFrame, through, type Angles } from '../../volume/oblique';
import type { Preview } from '../../volume/preview';
import { sampledSquare } from '../../volume/reslice';
import type { Window } from '../../volume/slices';
import { SliceGrip } from './slice_grip';
import { paintLetters, pixelsIn, sliceColours } from './slice_looks';
import { anglesOfText, anglesToText } from './slice_texts';

const colour = '#c792ea';
const pixels = 320;
const degrees = 180 / Math.PI;
// How far the handle is from the middle, in parts of the volume's size; and how near a pointer must be, in pixels.
const handleReach = 0.32;
const reach = { mouse: 10, touch: 20 };

export interface ObliqueHost {
  volume: Volume;
  cursor: () => Vec3;
  setCursor: (cursor: Vec3) => void;
  window: () => Window;
}

export class ObliqueView {
  readonly element: HTMLElement;
  readonly name = 'the oblique plane';
  // It is to be drawn anew in the slices.
  readonly changes = new Signal(0);
  private readonly canvas = h('canvas.oblique-picture', { tabindex: '0', role: 'img', width: pixels, height: pixels });
  private readonly turn = this.slider('Turn');
  private readonly tilt = this.slider('Tilt');
  private angles: Angles = { turn: Math.PI / 6, tilt: 0 };
  private preview: Preview | null = null;
  private isDrawing = false;

  constructor(
    private readonly host: ObliqueHost,
    private readonly scope: Scope,
  ) {
    this.element = h('figure.slice.oblique', { hidden: true }, [
      h('div.slice-picture', this.canvas),
      h('figcaption', h('span.slice-title', 'Oblique'), h('label', 'Turn', this.turn), h('label', 'Tilt', this.tilt)),
    ]);
    for (const slider of [this.turn, this.tilt]) {
      slider.addEventListener('input', () => this.set({ turn: this.turn.valueAsNumber / degrees, tilt: this.tilt.valueAsNumber / degrees }));
    }
    this.listen();
    scope.onEnd(sliceColours.subscribe(() => this.draw()));
    this.showAngles();
  }

  // For the address.
  get text(): string {
    return anglesToText(this.angles);
  }

  // False where the text says no angles.
  restore(text: string): boolean {
    const angles = anglesOfText(text);
    if (angles) this.set(angles);
    return angles !== null;
  }

  // Null takes it away.
  show(preview: Preview | null): void {
    this.preview = preview;
    if (!preview && this.element.classList.contains('enlarged')) this.element.querySelector<HTMLButtonElement>('.enlarge')?.click();
    this.element.hidden = preview === null;
    this.changed();
  }

  update(): void {
    this.draw();
  }

  // Where it cuts that slice, in the slice's samples as units.
  paint(context: CanvasRenderingContext2D, axis: Axis): void {
    const ends = this.preview && this.endsIn(axis);
    if (!ends) return;
    const at = context.getTransform();
    const [middle, handle] = ends.map(([x, y]) => at.transformPoint({ x: x + 0.5, y: y + 0.5 })) as [DOMPoint, DOMPoint];
    const ratio = window.devicePixelRatio || 1;
    const [dx, dy] = [handle.x - middle.x, handle.y - middle.y];
    context.save();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 1.5 * ratio;
    context.beginPath();
    context.moveTo(middle.x - 3 * dx, middle.y - 3 * dy);
    context.lineTo(middle.x + 3 * dx, middle.y + 3 * dy);
    context.stroke();
    context.beginPath();
    context.arc(handle.x, handle.y, 5 * ratio, 0, 2 * Math.PI);
    context.fill();
    context.restore();
  }

  // Its handle in slices across that axis.
  gripIn(axis: Axis): SliceGrip<Axis> {
    return new SliceGrip(({ place: [x, y], pixels: [wide, high], isTouch }) => {
      const handle = this.preview && this.endsIn(axis)?.[1];
      const isNear = handle && Math.hypot((x - handle[0]) * wide, (y - handle[1]) * high) < (isTouch ? reach.touch : reach.mouse);
      return isNear ? axis : null;
    }, (_, place) => this.turnTo(axis, place));
  }

  private turnTo(axis: Axis, place: readonly [number, number]): void {
    const from = toPatient(this.host.volume, this.host.cursor());
    const to = toPatient(this.host.volume, this.inVolume(axis, place));
    const direction = to.map((value, at) => value - from[at as 0]) as Vec3;
    if (Math.hypot(...direction) > 0) this.set(through(this.angles, direction, this.normalOf(axis)));
  }

  private slider(name: string): HTMLInputElement {
    return h('input', { type: 'range', min: -90, max: 90, step: 1, 'aria-label': `${name} of the oblique plane` });
  }

  private set(angles: Angles): void {
    this.angles = angles;
    this.showAngles();
    this.changed();
  }

  private showAngles(): void {
    const { turn, tilt } = this.angles;
    for (const [slider, angle] of [[this.turn, turn], [this.tilt, tilt]] as const) {
      slider.value = String(Math.round(angle * degrees));
      slider.setAttribute('aria-valuetext', `${slider.value} degrees`);
    }
  }

  private changed(): void {
    this.draw();
    this.changes.value += 1;
  }

  private normalOf(axis: Axis): Vec3 {
    const [across, down] = pictureAxes(axis);
    return cross(axisDirection(this.host.volume, across), axisDirection(this.host.volume, down));
  }

  private inVolume(axis: Axis, [column, row]: readonly [number, number]): Vec3 {
    const place: Vec3 = [...this.host.cursor()];
    const [across, down] = pictureAxes(axis);
    [place[across], place[down]] = [column, row];
    return place;
  }

  private get size(): number {
    const { dims, spacing } = this.host.volume;
    return Math.max(...dims.map((count, axis) => count * spacing[axis as 0]));
  }

  // The middle of its line in that slice, and its handle; null where it has none.
  private endsIn(axis: Axis): [readonly [number, number], readonly [number, number]] | null {
    const { volume } = this.host;
    const line = lineIn(this.angles, this.normalOf(axis));
    if (!line) return null;
    const cursor = this.host.cursor();
    const middle = toPatient(volume, cursor);
    const end = middle.map((value, at) => value + handleReach * this.size * line[at as 0]) as Vec3;
    const [across, down] = pictureAxes(axis);
    const placed = toSamples(volume, end);
    return [[cursor[across], cursor[down]], [placed[across], placed[down]]];
  }

  private draw(): void {
    if (this.isDrawing) return;
    this.isDrawing = true;
    requestAnimationFrame(() => {
      this.isDrawing = false;
      if (!this.scope.isOver && this.preview) this.render(this.preview);
    });
  }

  private render(preview: Preview): void {
    const { volume, cursor, window: shown } = this.host;
    const { right, down } = obliqueFrame(this.angles);
    const square = sampledSquare(preview, { middle: toPatient(volume, cursor()), right, down, size: this.size, pixels });
    paintImage(this.canvas, imageOf(square, pixelsIn(preview, shown())));
    const context = this.canvas.getContext('2d', { willReadFrequently: true });
    if (!context) return;
    context.fillStyle = colour;
    context.fillRect(pixels / 2 - 8, pixels / 2 - 0.5, 16, 1);
    context.fillRect(pixels / 2 - 0.5, pixels / 2 - 8, 1, 16);
    paintLetters(context, { left: sideOf(opposite(right)), right: sideOf(right), top: sideOf(opposite(down)), bottom: sideOf(down) }, 8, 1);
    const [turn, tilt] = [this.turn.value, this.tilt.value];
    this.canvas.dataset.angles = `${turn},${tilt}`;
    this.canvas.setAttribute('aria-label', `Oblique plane, turned by ${turn} and tilted by ${tilt} degrees, its right side towards ${sideOf(right)}`);
  }

  // A drag turns it, the wheel moves it along its normal, and a click sends the slices there.
  private listen(): void {
    const { canvas, scope } = this;
    let press: { x: number; y: number; from: Angles; moved: boolean } | null = null;
    scope.listen(canvas, 'pointerdown', (event: PointerEvent) => {
      canvas.setPointerCapture(event.pointerId);
      press = { x: event.clientX, y: event.clientY, from: this.angles, moved: false };
    });
    scope.listen(canvas, 'pointermove', (event: PointerEvent) => {
      if (!press) return;
      const [dx, dy] = [event.clientX - press.x, event.clientY - press.y];
      press.moved ||= Math.hypot(dx, dy) > 4;
      if (press.moved) this.set({ turn: turned(press.from.turn + dx / 150), tilt: turned(press.from.tilt + dy / 150) });
    });
    scope.listen(canvas, 'pointerup', (event: PointerEvent) => {
      if (press && !press.moved) this.goTo(event);
      press = null;
    });
    scope.listen(canvas, 'pointercancel', () => (press = null));
    const wheel = new WheelSteps();
    scope.listen(canvas, 'wheel', (event: WheelEvent) => {
      event.preventDefault();
      this.step(-wheel.steps(event));
    });
    scope.listen(canvas, 'keydown', (event: KeyboardEvent) => {
      const step = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1 }[event.key];
      if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      this.step(step);
    });
  }

  private step(by: number): void {
    if (by === 0) return;
    const { volume, cursor, setCursor } = this.host;
    const { normal } = obliqueFrame(this.angles);
    const length = by * Math.max(...volume.spacing);
    setCursor(sampleAt(volume, toPatient(volume, cursor()).map((value, axis) => value - length * normal[axis as 0]) as Vec3));
  }

  private goTo({ clientX, clientY }: PointerEvent): void {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const side = Math.min(width, height);
    const [x, y] = [clientX - left - width / 2, clientY - top - height / 2].map((value) => (value / side) * this.size) as [number, number];
    const { right, down } = obliqueFrame(this.angles);
    const { volume, cursor, setCursor } = this.host;
    setCursor(sampleAt(volume, toPatient(volume, cursor()).map((value, axis) => value + x * right[axis as 0] + y * down[axis as 0]) as Vec3));
  }
}

function turned(angle: number): number {
  return Math.max(-Math.PI / 2, Math.min(Math.PI / 2, angle));
}
