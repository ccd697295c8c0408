// The cut along a slice or at any angle: its controls, and the slice's picture on it.
import { client } from '../../client';
import type { Axis, Job, Volume } from '../../api/types';
import type { LabelState } from '../../job/labels';
import type { Surface } from '../../scene/surface';
import { button, checkbox, h, select } from '../../ui/dom';
import { formatSize } from '../../ui/format';
import { tellError } from '../../ui/notices';
import { greys, imageOf } from '../../ui/pixels';
import type { Scope } from '../../ui/signal';
import { axisIndex, patientAxes } from '../../volume/geometry';
import { defaultWindow } from '../../volume/histogram';
import type { LabelLook, NumberedSlice } from '../../volume/label_map';
import { SliceSource, type Window } from '../../volume/slices';
import { labelImage, labelOpacity } from '../labels/label_opacity';
import { CutPictures } from './cut_pictures';
import { FreeCut } from './free_cut';

const bins = 512;

// Over black.
function paintedLabels(slice: NumberedSlice, look: LabelLook): Promise<ImageBitmap> {
  const image = labelImage(slice, look);
  const pixels = image.data;
  for (let at = 0; at < pixels.length; at += 4) {
    const opacity = (pixels[at + 3] as number) / 255;
    for (let channel = 0; channel < 3; channel += 1) pixels[at + channel] = (pixels[at + channel] as number) * opacity;
    pixels[at + 3] = 255;
  }
  return createImageBitmap(image);
}

export class CutTool {
  readonly element = h('div.cut-controls', { hidden: true });
  // For the address: which slice, and on which side what stays; '' where nothing is cut.
  onChange: ((text: string) => void) | null = null;
  isOn = false;
  private axis: Axis;
  private index: number;
  private flipped = false;
  private readonly free: FreeCut;
  private isFree = false;
  // Axial first: what most people think of as a slice.
  private readonly axes: [Axis, string][];
  private window: Window | null = null;
  private readonly pictures: CutPictures<{ picture: ImageBitmap; direction: Axis | 'free' }>;
  private readonly source: SliceSource;
  private paintings = 0;

  constructor(
    private readonly scope: Scope,
    private readonly job: Job,
    private readonly volume: Volume,
    private readonly labels: LabelState,
    private readonly surface: Surface,
    private readonly view: HTMLElement,
  ) {
    const [sagittal, coronal, axial] = patientAxes(volume);
    this.axes = [
      [axial, 'Axial'],
      [coronal, 'Coronal'],
      [sagittal, 'Sagittal'],
    ];
    this.axis = axial;
    this.index = this.middle;
    this.source = new SliceSource(volume, scope);
    this.free = new FreeCut(volume, scope.signal);
    this.pictures = new CutPictures(scope, {
      fetch: async () => {
        const { direction } = this;
        return { direction, picture: await this.picture() };
      },
      onPicture: ({ picture, direction }, place) => {
        if (scope.isOver || !this.isOn || direction !== this.direction) picture.close();
        else this.showPicture(picture, place);
      },
      onError: (error) => {
        // That of the place before would be taken for this one's.
        this.showPicture(null);
        tellError(error);
      },
    });
    // Labels are painted anew where others are seen, or the same ones otherwise.
    if (labels.labels.length > 0) {
      for (const changed of [labels.hidden, labels.colours, labelOpacity]) scope.onEnd(changed.subscribe(() => this.repaint()));
    }
  }

  // As `onChange` told it; what is no cut of this volume changes nothing.
  restore(text: string): void {
    this.isFree = this.free.restore(text);
    if (this.isFree) {
      this.set(true, false);
      return;
    }
    const [, axis, index, side] = /^([xyz])(\d+)([+-])$/.exec(text) ?? [];
    if (axis === undefined || Number(index) >= this.volume.dims[axisIndex(axis as Axis)]) return;
    this.axis = axis as Axis;
    this.index = Number(index);
    this.flipped = side === '-';
    this.set(true, false);
  }

  set(isOn: boolean, turnsCamera = true): void {
    this.isOn = isOn;
    this.element.hidden = !isOn;
    this.surface.setCut(isOn);
    if (!isOn) {
      this.pictures.want('');
      this.surface.cut.show(null);
      delete this.view.dataset.slice;
      this.onChange?.('');
      return;
    }
    this.showControls();
    this.place();
    if (turnsCamera) this.surface.faceCut();
  }

  private get count(): number {
    return this.volume.dims[axisIndex(this.axis)];
  }

  private get direction(): Axis | 'free' {
    return this.isFree ? 'free' : this.axis;
  }

  private get middle(): number {
    return Math.floor(this.count / 2);
  }

  private showControls(): void {
    const directions: [Axis | 'free', string][] = [...this.axes, ['free', 'Free']];
    const take = (direction: Axis | 'free'): void => {
      // A picture along one direction is never shown along another.
      this.surface.cut.show(null);
      this.isFree = direction === 'free';
      if (direction === 'free') {
        this.free.faceView(this.surface);
      } else {
        this.axis = direction;
        this.index = this.middle;
      }
      this.showControls();
      this.place();
      if (!this.isFree) this.surface.faceCut();
    };
    const choice = select(directions, this.direction, take, { 'aria-label': 'Direction of the cut' });
    this.element.replaceChildren(choice, ...(this.isFree ? this.freeControls() : this.sliceControls()));
  }

  private slider(range: { min: number; max: number; step: number; value: number }, textOf: (value: number) => string, onValue: (value: number) => void): HTMLElement[] {
    const slider = h('input', { type: 'range', ...range, 'aria-label': 'Position of the cut' });
    const place = h('span.cut-place', textOf(range.value));
    slider.addEventListener('input', () => {
      onValue(slider.valueAsNumber);
      place.textContent = textOf(slider.valueAsNumber);
      this.place();
    });
    return [slider, place];
  }

  private sliceControls(): HTMLElement[] {
    const range = { min: 0, max: this.count - 1, step: 1, value: this.index };
    const other = checkbox('Other side', this.flipped, (flipped) => {
      this.flipped = flipped;
      this.place();
    });
    return [...this.slider(range, (index) => `${index + 1} / ${this.count}`, (index) => (this.index = index)), other];
  }

  private freeControls(): HTMLElement[] {
    const { free } = this;
    const reach = Math.ceil(free.reach);
    const range = { min: -reach, max: reach, step: 'any' as unknown as number, value: free.depth };
    const change = (how: () => void): void => {
      how();
      this.showControls();
      this.place();
    };
    return [
      ...this.slider(range, (depth) => `${formatSize(depth)} mm`, (depth) => (free.depth = depth)),
      button('Turn to the view', () => change(() => free.faceView(this.surface)), { title: 'Cut parallel to the screen, as the surface is seen now' }),
      button('Other side', () => change(() => free.flip())),
    ];
  }

  private place(): void {
    const { axis, index, flipped } = this;
    if (this.isFree) this.free.place(this.surface);
    else this.surface.cut.place(this.volume, { axis, index, flipped });
    this.surface.draw();
    this.onChange?.(this.isFree ? this.free.text : `${axis}${index}${flipped ? '-' : '+'}`);
    this.pictures.want(this.wanted);
  }

  private get wanted(): string {
    const place = this.isFree ? this.free.text : `${this.axis}/${this.index}`;
    return `${place}${this.paintings > 0 ? `/${this.paintings}` : ''}`;
  }

  private repaint(): void {
    this.paintings += 1;
    if (this.isOn) this.pictures.want(this.wanted);
  }

  private async picture(): Promise<ImageBitmap> {
    const { axis, index, volume } = this;
    const look = this.labels.look();
    if (look && this.isFree && !this.free.isTooLargeForLabels) {
      const { width, height, values } = await this.free.picture(volume.range, look);
      return paintedLabels({ width, height, labels: Uint16Array.from(values) }, look);
    }
    if (look && !this.isFree) {
      const { width, height, labels } = await this.source.get(axis, index, volume.range, look.map);
      return paintedLabels({ width, height, labels: labels ?? new Uint16Array(width * height) }, look);
    }
    if (this.window === null) {
      const { iso: asked } = this.job.parameters;
      const iso = typeof asked === 'number' ? asked : volume.suggested_iso;
      this.window = defaultWindow(await client.histogramOf(volume.id, bins, this.scope.signal), iso);
    }
    if (this.isFree) return createImageBitmap(imageOf(await this.free.picture(this.window, null), greys));
    return createImageBitmap(await client.slicePicture(volume.id, axis, index, this.window, this.scope.signal));
  }

  private showPicture(picture: ImageBitmap | null, place = ''): void {
    this.surface.cut.show(picture);
    if (picture) this.view.dataset.slice = place;
    else delete this.view.dataset.slice;
    this.surface.draw();
  }
}
