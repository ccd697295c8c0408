// What is at a place of a slice: its value or label, and where it lies in the patient.
import type { Vec3, Volume } from '../../api/types';
import { labelTitle } from '../../job/labels';
import { h } from '../../ui/dom';
import { formatValue, shortened } from '../../ui/format';
import { axisIndex, pictureAxes, toPatient } from '../../volume/geometry';
import type { LabelLook } from '../../volume/label_map';
import { exactText, type ExactSamples } from '../../volume/exact';
import { valueIn, type Slice, type ValueRange, type Window } from '../../volume/slices';
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

// Keeps the digits that the eight bits of a picture over that window tell.
export function rounded({ low, high }: ValueRange, [from, to]: Window): string {
  if (low === -Infinity) return `at most ${formatValue(high, to - from)}`;
  if (high === Infinity) return `at least ${formatValue(low, to - from)}`;
  const span = high - low;
  const digits = 10 ** Math.floor(Math.log10(Math.max(1e-12, span)));
  const middle = Math.round((low + high) / 2 / digits) * digits;
  return `about ${formatValue(shortened(middle, span), span)}`;
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
    const seen = slab ?? slice;
    return rounded(valueIn(seen, place[column], place[row]), seen.window);
  }
}
