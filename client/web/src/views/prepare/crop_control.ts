// Switches the crop of a job on, with its box as numbers.
import type { Vec3, Volume } from '../../api/types';
import { parameterOf } from '../../job/table';
import { checkbox, h } from '../../ui/dom';
import { formatSize } from '../../ui/format';
import { NumberField } from '../../ui/number_field';
import { wholeBox, within, type Box } from '../../volume/crop';

export class CropControl {
  readonly element: HTMLElement;
  private readonly numbers = h('div.crop-numbers');
  private readonly size = h('p.hint');
  private readonly fields: [NumberField, NumberField][];
  private box: Box | null;

  constructor(
    private readonly volume: Volume,
    box: Box | null,
    private readonly onChange: (box: Box | null) => void,
    // Says if all numbers are valid.
    private readonly mark: (isGood: boolean) => void,
  ) {
    this.box = box;
    const field = (axis: number, end: 0 | 1): NumberField => {
      const name = `${end === 0 ? 'First' : 'Last'} sample along ${'xyz'[axis] ?? ''}`;
      const made = new NumberField({ step: 1, min: 0, max: (volume.dims[axis as 0] ?? 1) - 1 }, { 'aria-label': name });
      made.input.addEventListener('change', () => this.take(axis as 0, end, made));
      return made;
    };
    this.fields = [0, 1, 2].map((axis) => [field(axis, 0), field(axis, 1)]);
    this.numbers.append(
      ...this.fields.flatMap(([low, high], axis) => [
        h('div.crop-axis', h('span', { 'aria-hidden': 'true' }, 'xyz'[axis] ?? ''), low.input, h('span', { 'aria-hidden': 'true' }, '\u2013'), high.input),
        low.fault,
        high.fault,
      ]),
      this.size,
    );
    const toggle = checkbox('Crop to a box', box !== null, (isOn) => this.onChange(isOn ? middleOf(volume) : null));
    this.element = h('div.crop', { 'data-parameter': 'crop', title: parameterOf('crop').help }, toggle, this.numbers);
    this.show(box);
  }

  show(box: Box | null): void {
    const before = this.box;
    this.box = box;
    this.numbers.hidden = box === null;
    this.fields.forEach((ends, axis) =>
      ends.forEach((field, end) => {
        const value = box?.[end as 0][axis as 0] ?? null;
        // A fault stays until it is corrected, or the box gets another edge there.
        const isNew = value !== (before?.[end as 0][axis as 0] ?? null);
        if ((isNew || !field.isMarked) && document.activeElement !== field.input) field.write(value);
      }),
    );
    this.tell();
    if (!box) return;
    const size = box[0].map((low, axis) => (box[1][axis as 0] - low) * this.volume.spacing[axis as 0]);
    this.size.textContent = `${size.map((value) => formatSize(value)).join(' \u00d7 ')} mm. Drag the edges of the box in the slices.`;
  }

  private tell(): void {
    this.mark(!this.fields.flat().some(({ isMarked }) => isMarked));
  }

  private take(axis: 0 | 1 | 2, end: 0 | 1, field: NumberField): void {
    if (!this.box) return;
    const { value } = field;
    const isGood = value !== null && Number.isFinite(value);
    field.mark(isGood ? '' : field.textFault || 'Enter a whole number.');
    this.tell();
    if (!isGood) return;
    const next: Box = [[...this.box[0]], [...this.box[1]]];
    next[end][axis] = value;
    this.onChange(within(this.volume, next));
  }
}

// The box of a new crop: the middle, so that its edges are visible.
function middleOf(volume: Volume): Box {
  const [, last] = wholeBox(volume);
  return within(volume, [last.map((value) => value * 0.15) as Vec3, last.map((value) => value * 0.85) as Vec3]);
}
