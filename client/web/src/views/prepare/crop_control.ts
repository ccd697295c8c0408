// Switches the crop of a job on, with its box as numbers.
import type { Vec3, Volume } from '../../api/types';
import { parameterOf } from '../../job/table';
import { checkbox, h } from '../../ui/dom';
import { formatNumber } from '../../ui/format';
import { wholeBox, within, type Box } from '../../volume/crop';

export class CropControl {
  readonly element: HTMLElement;
  private readonly numbers = h('div', { class: 'crop-numbers' });
  private readonly size = h('p', { class: 'hint' });
  private readonly inputs: [HTMLInputElement, HTMLInputElement][];
  private box: Box | null;

  constructor(
    private readonly volume: Volume,
    box: Box | null,
    private readonly onChange: (box: Box | null) => void,
  ) {
    this.box = box;
    const input = (axis: number, end: 0 | 1): HTMLInputElement => {
      const made = h('input', {
        type: 'number',
        min: 0,
        max: (volume.dims[axis as 0] ?? 1) - 1,
        step: 1,
        'aria-label': `${end === 0 ? 'First' : 'Last'} sample along ${'xyz'[axis] ?? ''}`,
      });
      made.addEventListener('change', () => this.take(axis as 0, end, made.valueAsNumber));
      return made;
    };
    this.inputs = [0, 1, 2].map((axis) => [input(axis, 0), input(axis, 1)]);
    this.numbers.append(
      ...this.inputs.map(([low, high], axis) =>
        h('div', { class: 'crop-axis' }, h('span', { 'aria-hidden': 'true' }, 'xyz'[axis] ?? ''), low, h('span', { 'aria-hidden': 'true' }, '\u2013'), high),
      ),
      this.size,
    );
    const toggle = checkbox('Crop to a box', box !== null, (isOn) => this.onChange(isOn ? middleOf(volume) : null));
    this.element = h('div', { class: 'crop', 'data-parameter': 'crop', title: parameterOf('crop').help }, toggle, this.numbers);
    this.show(box);
  }

  show(box: Box | null): void {
    this.box = box;
    this.numbers.hidden = box === null;
    if (!box) return;
    this.inputs.forEach((ends, axis) =>
      ends.forEach((input, end) => {
        if (document.activeElement !== input) input.value = String(box[end as 0][axis as 0]);
      }),
    );
    const size = box[0].map((low, axis) => (box[1][axis as 0] - low) * this.volume.spacing[axis as 0]);
    this.size.textContent = `${size.map((value) => formatNumber(value, 1)).join(' \u00d7 ')} mm. Drag the edges of the box in the slices.`;
  }

  private take(axis: 0 | 1 | 2, end: 0 | 1, value: number): void {
    if (!this.box || !Number.isFinite(value)) return;
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
