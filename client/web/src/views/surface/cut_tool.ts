// The cut along a slice: its controls, and the slice's picture on it.
import { client } from '../../client';
import type { Axis, Job, Volume } from '../../api/types';
import type { Surface } from '../../scene/surface';
import { checkbox, h } from '../../ui/dom';
import { tellError } from '../../ui/notices';
import type { Scope } from '../../ui/signal';
import { axisIndex, patientAxes } from '../../volume/geometry';
import { defaultWindow } from '../../volume/histogram';
import type { Window } from '../../volume/slices';

const bins = 512;

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

  constructor(
    private readonly scope: Scope,
    private readonly job: Job,
    private readonly volume: Volume,
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
    this.pictureWanted = `${axis}/${index}`;
    this.onChange?.(`${axis}${index}${flipped ? '-' : '+'}`);
    void this.fetchPicture();
  }

  // One request at a time; the place that is wanted last is the next.
  private async fetchPicture(): Promise<void> {
    if (this.isFetching) return;
    this.isFetching = true;
    const { volume } = this;
    try {
      let shown = '';
      while (this.pictureWanted !== '' && this.pictureWanted !== shown && !this.scope.isOver) {
        shown = this.pictureWanted;
        const { axis, index } = this;
        if (this.window === null) {
          const { iso: asked } = this.job.parameters;
          const iso = typeof asked === 'number' ? asked : volume.suggested_iso;
          this.window = defaultWindow(await client.histogramOf(volume.id, bins, this.scope.signal), iso);
        }
        const blob = await client.slicePicture(volume.id, axis, index, this.window, this.scope.signal);
        const picture = await createImageBitmap(blob);
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
