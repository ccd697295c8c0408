// What is at a place of a slice: its value or label, and where it lies in the patient.
import type { Vec3, Volume } from '../../api/types';
import { labelTitle } from '../../job/labels';
import { h } from '../../ui/dom';
import { formatValue, shortened } from '../../ui/format';
import { axisIndex, pictureAxes, toPatient } from '../../volume/geometry';
import type { LabelLook } from '../../volume/label_map';
import { onlyInteger, valueIn, type Slice, type ValueRange, type Window } from '../../volume/slices';
import { placeText, sliceSpace } from './slice_looks';

export interface ReadoutHost {
  volume: Volume;
  isInteger: boolean;
  // The slice that is shown, if it is there.
  slice: () => Slice | null;
  // Shown instead of that slice; null for none.
  slabOf: (slice: Slice) => Slice | null;
  // Null where samples are values.
  labels: () => LabelLook | null;
}

interface Reading {
  text: string;
  value: number | null;
}

// Keeps the digits that the eight bits of a picture over that window tell.
export function rounded({ low, high }: ValueRange, [from, to]: Window): Reading {
  if (low === -Infinity) return { text: `at most ${formatValue(high, to - from)}`, value: null };
  if (high === Infinity) return { text: `at least ${formatValue(low, to - from)}`, value: null };
  const span = high - low;
  const digits = 10 ** Math.floor(Math.log10(Math.max(1e-12, span)));
  const middle = Math.round((low + high) / 2 / digits) * digits;
  const value = shortened(middle, span);
  return { text: `about ${formatValue(value, span)}`, value };
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
    const value = this.textAt(place);
    const where = placeText(toPatient(this.host.volume, place), sliceSpace.value, this.host.volume.spacing);
    const text = [value, where].filter(Boolean).join(' \u00b7 ');
    if (this.element.textContent === text) return;
    const reading = value !== '' && h('span.slice-reading', value);
    this.element.replaceChildren(...[reading, h('span.slice-where', text.slice(value.length))].filter((part) => part !== false));
  }

  // Says what is seen at that place.
  private textAt(place: Vec3): string {
    const slice = this.host.slice();
    const slab = slice && this.host.slabOf(slice);
    if (!slab || place[axisIndex(slab.axis)] !== slab.index) return this.valueAt(place).text;
    const [column, row] = pictureAxes(slab.axis);
    return rounded(valueIn(slab, place[column], place[row]), slab.window).text;
  }

  // Reads the slice, also while a slab is shown: the mean of a slab is the value of no sample. Null where the picture tells no value.
  valueAt(place: Vec3 | null): Reading {
    const slice = this.host.slice();
    if (!slice || place?.[axisIndex(slice.axis)] !== slice.index) return { text: '', value: null };
    const [column, row] = pictureAxes(slice.axis);
    const labels = this.host.labels();
    if (labels && slice.labels) {
      const label = labels.map.at(slice.labels[place[row] * slice.width + place[column]] ?? 0);
      return { text: label ? labelTitle(label) : 'no label', value: null };
    }
    const range = valueIn(slice, place[column], place[row]);
    const exact = this.host.isInteger ? onlyInteger(range) : null;
    if (exact !== null) return { text: formatValue(exact), value: exact };
    return rounded(range, slice.window);
  }
}
