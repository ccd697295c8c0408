// The cut along a slice: its controls, and the slice's picture on it.
import { client } from '../../client';
import type { Axis, Job, Volume } from '../../api/types';
import type { LabelState } from '../../job/labels';
import type { Surface } from '../../scene/surface';
import { checkbox, h } from '../../ui/dom';
import { tellError } from '../../ui/notices';
import type { Scope } from '../../ui/signal';
import { axisIndex, patientAxes } from '../../volume/geometry';
import { defaultWindow } from '../../volume/histogram';
import { coloursOf, paintLabels, type LabelLook, type NumberedSlice } from '../../volume/label_map';
import { SliceSource, type Window } from '../../volume/slices';
import { labelOpacity } from '../labels/label_opacity';

const bins = 512;

// Over black.
function paintedLabels(slice: NumberedSlice, look: LabelLook): Promise<ImageBitmap> {
  const pixels = paintLabels(slice, coloursOf(look), labelOpacity.value);
  for (let at = 0; at < pixels.length; at += 4) {
    const opacity = (pixels[at + 3] as number) / 255;
    for (let channel = 0; channel < 3; channel += 1) pixels[at + channel] = (pixels[at + channel] as number) * opacity;
    pixels[at + 3] = 255;
  }
  return createImageBitmap(new ImageData(pixels, slice.width, slice.height));
}

export class CutTool {
  readonly element = h('div', { class: 'cut-controls', hidden: true });
  // For the address: which slice, and on which side what stays; '' where nothing is cut.
  onChange: ((text: string) => void) | null = null;
  isOn = false;
  private axis: Axis;
  private index: number;
  private flipped = false;
  // Axial first: what most people think of as a slice.
  private readonly axes: [string, Axis][];
  private window: Window | null = null;
  private pictureWanted = '';
  private isFetching = false;
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
      ['Axial', axial],
      ['Coronal', coronal],
      ['Sagittal', sagittal],
    ];
    this.axis = axial;
    this.index = this.middle;
    this.source = new SliceSource(volume, scope.signal);
    // Labels are painted anew where others are seen, or the same ones otherwise.
    if (labels.labels.length > 0) {
      for (const changed of [labels.hidden, labels.colours, labelOpacity]) scope.onEnd(changed.subscribe(() => this.repaint()));
    }
  }

  // As `onChange` told it; what is no cut of this volume changes nothing.
  restore(text: string): void {
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
      this.pictureWanted = '';
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

  private get middle(): number {
    return Math.floor(this.count / 2);
  }

  private showControls(): void {
    const slider = h('input', { type: 'range', min: 0, max: this.count - 1, step: 1, 'aria-label': 'Position of the cut' });
    slider.value = String(this.index);
    const place = h('span', { class: 'cut-place' }, `${this.index + 1} / ${this.count}`);
    slider.addEventListener('input', () => {
      this.index = slider.valueAsNumber;
      place.textContent = `${this.index + 1} / ${this.count}`;
      this.place();
    });
    const choice = h(
      'select',
      { 'aria-label': 'Direction of the cut' },
      ...this.axes.map(([name, axis]) => h('option', { value: axis, selected: axis === this.axis }, name)),
    );
    choice.addEventListener('change', () => {
      this.axis = choice.value as Axis;
      this.index = this.middle;
      this.showControls();
      this.place();
      this.surface.faceCut();
    });
    const other = checkbox('Other side', this.flipped, (flipped) => {
      this.flipped = flipped;
      this.place();
    });
    this.element.replaceChildren(choice, slider, place, other);
  }

  private place(): void {
    const { axis, index, flipped } = this;
    this.surface.cut.place(this.volume, { axis, index, flipped });
    this.surface.draw();
    this.pictureWanted = this.wanted;
    this.onChange?.(`${axis}${index}${flipped ? '-' : '+'}`);
    void this.fetchPicture();
  }

  private get wanted(): string {
    return `${this.axis}/${this.index}${this.paintings > 0 ? `/${this.paintings}` : ''}`;
  }

  private repaint(): void {
    this.paintings += 1;
    if (!this.isOn) return;
    this.pictureWanted = this.wanted;
    void this.fetchPicture();
  }

  private async picture(): Promise<ImageBitmap> {
    const { axis, index, volume } = this;
    const look = this.labels.look();
    if (look) {
      const { width, height, labels } = await this.source.get(axis, index, volume.range, look.map);
      return paintedLabels({ width, height, labels: labels ?? new Uint16Array(width * height) }, look);
    }
    if (this.window === null) {
      const { iso: asked } = this.job.parameters;
      const iso = typeof asked === 'number' ? asked : volume.suggested_iso;
      this.window = defaultWindow(await client.histogramOf(volume.id, bins, this.scope.signal), iso);
    }
    return createImageBitmap(await client.slicePicture(volume.id, axis, index, this.window, this.scope.signal));
  }

  // One request at a time; the place that is wanted last is the next.
  private async fetchPicture(): Promise<void> {
    if (this.isFetching) return;
    this.isFetching = true;
    try {
      let shown = '';
      while (this.pictureWanted !== '' && this.pictureWanted !== shown && !this.scope.isOver) {
        shown = this.pictureWanted;
        const picture = await this.picture();
        if (this.scope.isOver || !this.isOn) picture.close();
        else {
          this.surface.cut.show(picture);
          this.view.dataset.slice = shown;
          this.surface.draw();
        }
      }
    } catch (error) {
      if (!this.scope.isOver) tellError(error);
    } finally {
      this.isFetching = false;
    }
  }
}
