// What is at a place of a slice: its value or label, and where it lies in the patient.
import type { Vec3, Volume } from '../../api/types';
import { labelTitle } from '../../job/labels';
import { h } from '../../ui/dom';
import { formatValue, shortened } from '../../ui/format';
import { axisIndex, pictureAxes, toPatient } from '../../volume/geometry';
import type { LabelLook } from '../../volume/label_map';
import { exactText, type ExactSamples } from '../../volume/exact';
import type { Slice } from '../../volume/slices';
import { placeText, sliceSpace } from './slice_looks';

export interface ReadoutHost {
  volume: Volume;
  exact: ExactSamples;
  // The slice that is shown, if it is there.
  slice: () => Slice | null;
  // Shown instead of that slice; null for none.
  slabOf: (slice: Slice) => Slice | null;
  // Null where samples are values.
  labels: () => LabelLook | null;
  // The label of the overlay there; '' for none.
  overlaid: (place: Vec3) => string;
}

// A sample's value with the digits that the slice's eight bits tell.
export function seenText({ window: [low, high], values, width }: Slice, column: number, row: number): string {
  const value = values[row * width + column] ?? 0;
  const step = (high - low) / 255;
  const middle = low + value * step;
  // At both ends of the window it may be anything beyond.
  if (value === 0) return `at most ${formatValue(middle + step / 2, high - low)}`;
  if (value === 255) return `at least ${formatValue(middle - step / 2, high - low)}`;
  const digits = 10 ** Math.floor(Math.log10(Math.max(1e-12, step)));
  return `about ${formatValue(shortened(Math.round(middle / digits) * digits, step), step)}`;
}

export class SliceReadout {
  readonly element = h('p.slice-value', { 'aria-hidden': 'true' });
  // Under the pointer; null: none, and the place where the slices meet is told.
  private pointed: Vec3 | null = null;

  constructor(private readonly host: ReadoutHost) {}

  point(place: Vec3 | null, cursor: Vec3): void {
    this.pointed = place;
    this.show(cursor);
  }

  show(cursor: Vec3): void {
    const place = this.pointed ?? cursor;
    const value = [this.textAt(place), this.host.overlaid(place)].filter(Boolean).join(' \u00b7 ');
    const where = placeText(toPatient(this.host.volume, place), sliceSpace.value, this.host.volume.spacing);
    const text = [value, where].filter(Boolean).join(' \u00b7 ');
    if (this.element.textContent === text) return;
    const reading = value !== '' && h('span.slice-reading', value);
    this.element.replaceChildren(...[reading, h('span.slice-where', text.slice(value.length))].filter((part) => part !== false));
  }

  // Says what is seen at that place. The mean of a slab is the value of no sample.
  private textAt(place: Vec3): string {
    const slice = this.host.slice();
    if (!slice || place[axisIndex(slice.axis)] !== slice.index) return '';
    const [column, row] = pictureAxes(slice.axis);
    const labels = this.host.labels();
    if (labels && slice.labels) {
      const label = labels.map.at(slice.labels[place[row] * slice.width + place[column]] ?? 0);
      return label ? labelTitle(label) : 'no label';
    }
    const slab = this.host.slabOf(slice);
    const exact = slab ? null : this.host.exact.valueAt(slice.axis, place);
    if (exact !== null) return exactText(exact);
    return seenText(slab ?? slice, place[column], place[row]);
  }
}
