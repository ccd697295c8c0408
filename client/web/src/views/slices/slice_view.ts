// One orthogonal slice: grey samples, the iso-contour over them, and the place of the other two planes.
import type { Axis, Vec3, Volume } from '../../api/types';
import { h, uniqueId } from '../../ui/dom';
import { imageOf, paintImage } from '../../ui/pixels';
import type { Scope } from '../../ui/signal';
import { WheelSteps } from '../../ui/wheel';
import { contour } from '../../volume/contour';
import type { LabelLook } from '../../volume/label_map';
import { labelImage, labelOpacity } from '../labels/label_opacity';
import { SliceCrop, type CropHost } from './slice_crop';
import { paintLetters, pixelsIn, sliceColours, sliceSpace } from './slice_looks';
import type { ObliqueView } from './oblique_view';
import { SliceGrip, type Spot } from './slice_grip';
import type { SliceLayers } from './slice_layers';
import type { SliceMeasures } from './slice_measure';
import { SliceReadout } from './slice_readout';
import { SliceZoom } from './slice_zoom';
import {
  axisIndex,
  pictureAxes,
  placedAt,
  slicePlacement,
  slicePlane,
  type Placement,
  type Plane,
  type SlicePlane,
} from '../../volume/geometry';
import { SliceLoader } from '../../volume/slice_loader';
import { draggedWindow, inSlice, windowToFetch, type Slice, type SliceSource, type Window } from '../../volume/slices';

export interface SliceState {
  iso: number | null; // of the contour
  // Null where samples are values, and not labels.
  labels: LabelLook | null;
  window: Window;
  // The sample where the three planes meet.
  cursor: Vec3;
}

export interface SliceHost {
  volume: Volume;
  source: SliceSource;
  commonWindow: Window;
  state: () => SliceState;
  setWindow: (window: Window) => void;
  setCursor: (cursor: Vec3) => void;
  setIso: (iso: number) => void;
  contourColour: () => string;
  // Null where nothing can be cropped.
  crop: CropHost | null;
  onError: (error: unknown) => void;
  // Null where nothing is measured.
  measures: SliceMeasures | null;
  // Null where nothing is shown beside the samples.
  layers: SliceLayers | null;
  oblique: ObliqueView | null;
}

interface Press {
  pointer: number;
  x: number;
  y: number;
  window: Window;
  moved: boolean;
  isWindowing: boolean;
}

const titles: Record<Plane, string> = { axial: 'Axial', coronal: 'Coronal', sagittal: 'Sagittal' };
const padding = 14;
// How much is seen of a slice that stands in for one that is not there yet.
const otherSlice = 0.35;
// How near a pointer must be to the place where the lines meet, in pixels.
const crossReach = 7;
const cropColour = '#f2b33d';

export class SliceView {
  readonly element: HTMLElement;
  private readonly canvas = h('canvas', { tabindex: '0', role: 'img' });
  private readonly slider: HTMLInputElement;
  private readonly place = h('span.slice-place');
  private readonly layout: SlicePlane;
  private readonly buffer = document.createElement('canvas');
  private readonly loader: SliceLoader;
  private readonly state = h('p.slice-state', { role: 'status' });
  private readonly readout: SliceReadout;
  private readonly zoom: SliceZoom;
  private readonly crop: SliceCrop | null;
  private readonly grips: Pick<SliceGrip<unknown>, 'isAt' | 'hold' | 'move' | 'letGo'>[];
  private scheduled = false;

  constructor(
    private readonly plane: Plane,
    private readonly host: SliceHost,
    private readonly scope: Scope,
  ) {
    this.layout = slicePlane(host.volume, plane);
    const id = uniqueId('slice');
    this.slider = h('input', {
      type: 'range',
      id,
      min: 0,
      max: this.count(this.layout.normal) - 1,
      step: 1,
      'aria-label': `${titles[plane]} slice`,
    });
    this.slider.disabled = this.count(this.layout.normal) === 1;
    this.slider.addEventListener('input', () => this.goTo(Number(this.slider.value)));
    this.crop = host.crop && new SliceCrop(host.crop, pictureAxes(this.layout.normal));
    this.grips = [host.oblique?.gripIn(this.layout.normal), this.crop?.grip, this.crossGrip()].filter((grip) => grip != null);
    this.readout = new SliceReadout({
      volume: host.volume,
      exact: host.source.exact,
      slice: () => this.loader.slice,
      slabOf: ({ axis, index }) => host.layers?.projected(axis, index) ?? null,
      labels: () => host.state().labels,
      overlaid: (place) => host.layers?.labelAt(place) ?? '',
    });
    this.zoom = new SliceZoom(this.canvas, scope, () => this.draw());
    this.element = h('figure.slice', { 'data-plane': plane }, [
      h('div.slice-picture', this.canvas, this.state, this.readout.element, this.zoom.element),
      h('figcaption', h('span.slice-title', titles[plane]), this.slider, this.place),
    ]);
    this.loader = new SliceLoader(host.source, this.layout.normal, this.count(this.layout.normal), scope, {
      onChange: () => this.draw(),
      onRefused: (error) => host.onError(error),
    });
    this.listen();
    this.listenToSteps();
    this.listenToValues();
    const resizing = new ResizeObserver(() => this.draw());
    resizing.observe(this.canvas);
    scope.onEnd(() => resizing.disconnect());
    for (const look of [host.source.exact.changes, labelOpacity, sliceColours, sliceSpace, host.measures?.changes, host.layers?.changes, host.oblique?.changes]) {
      if (look) scope.onEnd(look.subscribe(() => this.draw()));
    }
  }

  // For who hears it.
  get name(): string {
    return `${this.plane} slices`;
  }

  // Shows the state as it is now.
  update(): void {
    const { iso, labels, window, cursor } = this.host.state();
    const index = cursor[axisIndex(this.layout.normal)];
    this.slider.value = String(index);
    this.place.textContent = `${index + 1} / ${this.count(this.layout.normal)}`;
    const fetched = windowToFetch(window, iso ?? window[0], this.host.commonWindow);
    this.loader.want(index, fetched, labels?.map ?? null);
    this.draw();
  }

  private count(axis: Axis): number {
    return this.host.volume.dims[axisIndex(axis)];
  }

  private goTo(index: number): void {
    const axis = axisIndex(this.layout.normal);
    const cursor: Vec3 = [...this.host.state().cursor];
    cursor[axis] = Math.max(0, Math.min(this.count(this.layout.normal) - 1, Math.round(index)));
    this.host.setCursor(cursor);
  }

  private step(by: number): void {
    if (by !== 0) this.goTo(this.host.state().cursor[axisIndex(this.layout.normal)] + by);
  }

  // The picture's place on the canvas, in canvas pixels.
  private placement(): Placement {
    const { width, height, clientWidth } = this.canvas;
    const edge = padding * (width / (clientWidth || 1));
    const whole = slicePlacement(this.host.volume, this.layout, { width, height, edge });
    return this.zoom.zoom.placed(whole, width, height);
  }

  // The place where the lines meet; not while points of a measurement are clicked.
  private crossGrip(): SliceGrip<true> {
    const [column, row] = pictureAxes(this.layout.normal);
    const isNear = ({ place: [x, y], pixels: [wide, high], isTouch }: Spot): boolean => {
      const { cursor } = this.host.state();
      return !isTouch && !this.host.measures?.kind.value && Math.hypot((x - cursor[column]) * wide, (y - cursor[row]) * high) < crossReach;
    };
    return new SliceGrip((spot) => isNear(spot) || null, (_, place) => {
      const cursor: Vec3 = [...this.host.state().cursor];
      for (const [at, axis] of [column, row].entries()) {
        cursor[axis] = Math.max(0, Math.min(this.host.volume.dims[axis] - 1, Math.round(place[at as 0])));
      }
      this.host.setCursor(cursor);
    });
  }

  private draw(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      if (!this.scope.isOver) this.paint();
    });
  }

  private paint(): void {
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(this.canvas.clientWidth * ratio);
    const height = Math.round(this.canvas.clientHeight * ratio);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    // Drawn by the processor: if the graphics processor is emulated, it needs seconds for a long contour.
    const context = this.canvas.getContext('2d', { willReadFrequently: true });
    if (!context || width === 0 || height === 0) return;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = '#000';
    context.fillRect(0, 0, width, height);
    const { iso, cursor } = this.host.state();
    const index = cursor[axisIndex(this.layout.normal)];
    const { slice, isLate, error } = this.loader;
    if (slice) {
      // A picture of another slice is never shown as this one.
      context.globalAlpha = slice.index === index ? 1 : otherSlice;
      this.paintSlice(context, slice, ratio);
      context.globalAlpha = 1;
    }
    const { right, down } = this.layout;
    paintLetters(context, { left: right.begin, right: right.end, top: down.begin, bottom: down.end }, (padding / 2) * ratio, ratio);
    this.readout.show(cursor);
    const says = error ? `Slice ${index + 1} could not be loaded` : isLate ? `Loading slice ${index + 1}` : '';
    if (this.state.textContent !== says) this.state.textContent = says;
    const measured = (this.measured(index) ?? []).map(({ text }) => text).filter(Boolean);
    const contoured = iso === null ? '' : ` with the contour at iso-value ${iso}`;
    this.canvas.setAttribute('aria-label', [`${titles[this.plane]} slice ${index + 1}${contoured}`, ...measured].join(', '));
  }

  private paintSlice(context: CanvasRenderingContext2D, slice: Slice, ratio: number): void {
    const { iso, labels, cursor, window } = this.host.state();
    const { layers } = this.host;
    const projected = layers?.projected(slice.axis, slice.index) ?? null;
    const { width, height, labels: numbers } = slice;
    const isOfLabels = numbers && labels && !projected;
    paintImage(this.buffer, isOfLabels ? labelImage({ width, height, labels: numbers }, labels) : imageOf(projected ?? slice, pixelsIn(projected ?? slice, window)));
    context.save();
    context.setTransform(...this.placement());
    context.imageSmoothingEnabled = labels === null;
    context.drawImage(this.buffer, 0, 0);
    layers?.paint(context, slice.axis, slice.index);
    this.host.oblique?.paint(context, slice.axis);

    // The contour is one slice's.
    const segments = iso === null || projected ? [] : contour(slice, inSlice(slice, iso));
    const [column, row] = pictureAxes(this.layout.normal);
    context.translate(0.5, 0.5);
    context.beginPath();
    context.moveTo(cursor[column], -0.5);
    context.lineTo(cursor[column], slice.height - 0.5);
    context.moveTo(-0.5, cursor[row]);
    context.lineTo(slice.width - 0.5, cursor[row]);
    strokePixels(context, ratio, 'rgba(255, 255, 255, 0.28)');
    context.beginPath();
    for (let i = 0; i + 3 < segments.length; i += 4) {
      context.moveTo(segments[i] as number, segments[i + 1] as number);
      context.lineTo(segments[i + 2] as number, segments[i + 3] as number);
    }
    strokePixels(context, 1.5 * ratio, this.host.contourColour());
    if (this.crop?.paint(context)) strokePixels(context, 1.5 * ratio, cropColour);
    this.host.measures?.paint(context, ratio, this.measured(cursor[axisIndex(this.layout.normal)]) ?? []);
    context.restore();
  }

  // The column and row of the picture under a point of the screen.
  private pointAt(event: PointerEvent | MouseEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    const scale = this.canvas.width / (box.width || 1);
    return placedAt(this.placement(), (event.clientX - box.left) * scale, (event.clientY - box.top) * scale);
  }

  // From the middles of samples, as a box is told.
  private placeAt(event: PointerEvent): [number, number] {
    const [column, row] = this.pointAt(event);
    return [column - 0.5, row - 0.5];
  }

  private measured(index: number): ReturnType<SliceMeasures['textsOf']> | undefined {
    const { measures, source, volume } = this.host;
    const { normal } = this.layout;
    return measures?.textsOf(volume, this.layout, index, () => (this.host.state().labels ? null : source.exact.find(normal, index)));
  }

  // Whether the click was one of a measurement.
  private isMeasuring(event: PointerEvent): boolean {
    const index = this.host.state().cursor[axisIndex(this.layout.normal)];
    return this.host.measures?.take(this.plane, index, this.placeAt(event)) ?? false;
  }

  private spotAt(event: PointerEvent): Spot {
    const [a, b, c, d] = this.placement();
    const ratio = window.devicePixelRatio || 1;
    const pixels: [number, number] = [Math.hypot(a, b) / ratio, Math.hypot(c, d) / ratio];
    return { place: this.placeAt(event), pixels, isTouch: event.pointerType === 'touch' };
  }

  // The sample under a point of the screen.
  private sampleAt(event: PointerEvent | MouseEvent): Vec3 | null {
    const point = this.pointAt(event);
    const cursor: Vec3 = [...this.host.state().cursor];
    const { dims } = this.host.volume;
    for (const [at, axis] of pictureAxes(this.layout.normal).entries()) {
      const index = Math.floor(point[at as 0]);
      if (index < 0 || index >= dims[axis]) return null;
      cursor[axis] = index;
    }
    return cursor;
  }

  private listen(): void {
    let press: Press | null = null;
    const { canvas, scope } = this;
    scope.listen(canvas, 'pointerdown', (event: PointerEvent) => {
      if ((event.button !== 0 && event.button !== 2) || event.shiftKey) return;
      if (!event.isPrimary) {
        // A second finger: a pinch, or the palm.
        press = null;
        return;
      }
      canvas.setPointerCapture(event.pointerId);
      if (this.grips.some((grip) => grip.hold(event.pointerId, this.spotAt(event)))) return;
      press = {
        pointer: event.pointerId,
        x: event.clientX,
        y: event.clientY,
        window: this.host.state().window,
        moved: false,
        isWindowing: false,
      };
    });
    scope.listen(canvas, 'pointermove', (event: PointerEvent) => {
      const spot = this.spotAt(event);
      if (this.grips.some((grip) => grip.move(event.pointerId, spot))) return;
      if (event.pointerType === 'mouse') canvas.classList.toggle('on-edge', this.grips.some((grip) => grip.isAt(spot)));
      if (press?.pointer !== event.pointerId || this.zoom.isMoving(event)) return;
      const dx = event.clientX - press.x;
      const dy = event.clientY - press.y;
      press.moved ||= Math.hypot(dx, dy) > (event.pointerType === 'mouse' ? 3 : 10);
      // A finger that goes up or down scrolls the page, which the browser sees to (touch-action).
      if (event.pointerType !== 'mouse' && Math.abs(dy) > Math.abs(dx) && !press.isWindowing) return;
      // A slip while measuring means no window.
      press.isWindowing ||= press.moved && (this.host.measures?.kind.value ?? null) === null;
      if (press.isWindowing) this.host.setWindow(draggedWindow(press.window, dx, dy));
    });
    scope.listen(canvas, 'pointerup', (event: PointerEvent) => {
      if (this.grips.some((grip) => grip.letGo(event.pointerId)) || press?.pointer !== event.pointerId) return;
      const cursor = press.moved ? null : this.sampleAt(event);
      press = null;
      if (cursor && !this.isMeasuring(event)) this.host.setCursor(cursor);
    });
    scope.listen(canvas, 'pointercancel', (event: PointerEvent) => {
      for (const grip of this.grips) grip.letGo(event.pointerId);
      // The browser has taken the finger to scroll with: what it did here before was not meant.
      if (press?.isWindowing) this.host.setWindow(press.window);
      press = null;
    });
    scope.listen(canvas, 'contextmenu', (event) => event.preventDefault());
  }

  private listenToValues(): void {
    const { canvas, scope } = this;
    const take = (place: Vec3 | null): void => {
      if (!place || this.host.state().labels) return;
      this.host.source.exact.read(this.layout.normal, place).then(
        (value) => {
          if (value !== null) this.host.setIso(value);
        },
        (error: unknown) => this.host.onError(error),
      );
    };
    scope.listen(canvas, 'pointermove', (event: PointerEvent) => {
      if (event.pointerType === 'mouse') this.readout.point(this.sampleAt(event), this.host.state().cursor);
    });
    scope.listen(canvas, 'pointerleave', () => this.readout.point(null, this.host.state().cursor));
    scope.listen(canvas, 'dblclick', (event: MouseEvent) => {
      if (!this.host.measures?.finish()) take(this.sampleAt(event));
    });
    scope.listen(canvas, 'keydown', (event: KeyboardEvent) => {
      if (event.key === 'i' && !event.ctrlKey && !event.metaKey && !event.altKey) take(this.host.state().cursor);
    });
  }

  private listenToSteps(): void {
    const { canvas, scope } = this;
    const wheel = new WheelSteps();
    scope.listen(canvas, 'wheel', (event: WheelEvent) => {
      event.preventDefault();
      if (event.ctrlKey || event.metaKey) this.zoom.wheel(event);
      else this.step(wheel.steps(event));
    });
    scope.listen(canvas, 'keydown', (event: KeyboardEvent) => {
      const key = event.key;
      const step = { ArrowUp: 1, ArrowRight: 1, PageUp: 10, ArrowDown: -1, ArrowLeft: -1, PageDown: -10 }[key];
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.shiftKey && key.startsWith('Arrow')) {
        const dx = key === 'ArrowLeft' ? -8 : key === 'ArrowRight' ? 8 : 0;
        const dy = key === 'ArrowUp' ? -8 : key === 'ArrowDown' ? 8 : 0;
        this.host.setWindow(draggedWindow(this.host.state().window, dx, dy));
      } else if (step !== undefined) this.step(step);
      else return;
      event.preventDefault();
    });
  }
}

// Strokes the path with a width in pixels, however the samples are stretched.
function strokePixels(context: CanvasRenderingContext2D, width: number, colour: string): void {
  context.save();
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.lineWidth = width;
  context.lineCap = 'round';
  context.strokeStyle = colour;
  context.stroke();
  context.restore();
}
