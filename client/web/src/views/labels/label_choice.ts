// The choice of labels to mesh: all labels of a volume, or some of a list.
import { client } from '../../client';
import { asApiError } from '../../api/problem';
import type { JobParameters, Label, Vec3, Volume, VolumeLabel } from '../../api/types';
import { isRenumbered, labelTitle, middleOf } from '../../job/labels';
import { button, checkbox, field, h } from '../../ui/dom';
import { formatCount } from '../../ui/format';
import { refusal } from '../../ui/notices';
import { NumberField } from '../../ui/number_field';
import type { Scope } from '../../ui/signal';
import { colourOf, lookOf, type LabelLook } from '../../volume/label_map';
import { opacityControl } from './label_opacity';
import { LabelSearch, swatchOf } from './label_search';

export type Choice = Pick<JobParameters, 'labels' | 'background'>;

interface Box {
  element: HTMLElement;
  input: HTMLInputElement;
  size: HTMLElement;
  voxels: number;
}

export class LabelChoice {
  readonly element: HTMLElement;
  private readonly body = h('div.label-choice');
  private background: number;
  private asking: AbortController | null = null;
  private labels: readonly VolumeLabel[] = [];
  private readonly chosen = new Set<Label>();
  private readonly boxes = new Map<Label, Box>();
  private triangles: ReadonlyMap<Label, number> = new Map();
  private search: LabelSearch<VolumeLabel> | null = null;
  // What `look` gives, made once for all labels.
  private shown: LabelLook | null = null;

  // `onChange` gets undefined labels while none is chosen. `onLook`: other labels are to be seen, see `look`.
  constructor(
    scope: Scope,
    private readonly volume: Volume,
    start: Choice,
    private readonly onChange: (choice: Choice) => void,
    private readonly onLook: () => void,
    private readonly onPlace: (place: Vec3) => void,
  ) {
    this.background = start.background ?? 0;
    this.element = h('div.label-choice', this.body, opacityControl(), this.backgroundField());
    scope.onEnd(() => this.asking?.abort());
    this.ask(start.labels);
  }

  private backgroundField(): HTMLElement {
    const number = new NumberField({ step: 1 });
    number.write(this.background);
    number.input.addEventListener('change', () => {
      const { value } = number;
      const isGood = value !== null && Number.isInteger(value);
      number.mark(isGood ? '' : number.textFault || 'Enter a whole number.');
      if (!isGood || value === this.background) return;
      this.background = value;
      this.ask('all');
      this.changed();
    });
    const element = field('Background', number.input, 'The value of samples without a label');
    element.append(number.fault);
    return element;
  }

  private ask(wanted: Choice['labels']): void {
    this.asking?.abort();
    const asking = new AbortController();
    this.asking = asking;
    this.body.replaceChildren(h('p', { role: 'status' }, 'Counting the labels'));
    this.labels = [];
    this.shown = null;
    this.chosen.clear();
    this.boxes.clear();
    this.search = null;
    client.labelsOf(this.volume.id, this.background, asking.signal).then(
      ({ labels }) => {
        if (!asking.signal.aborted) this.show(labels, wanted);
      },
      (error: unknown) => {
        if (!asking.signal.aborted) this.body.replaceChildren(refusal(asApiError(error)));
      },
    );
  }

  private show(labels: readonly VolumeLabel[], start: Choice['labels']): void {
    this.labels = labels;
    if (labels.length === 0) {
      this.body.replaceChildren(h('p.warning', 'All samples are background. The volume has no labels.'));
      return;
    }
    const wanted = Array.isArray(start) ? new Set(start) : null;
    for (const { label } of labels) if (!wanted || wanted.has(label)) this.chosen.add(label);
    this.search = new LabelSearch(
      labels,
      (label) => this.boxOf(label).element,
      () => `${formatCount(this.chosen.size)} of ${formatCount(labels.length)} labels`,
    );
    this.body.replaceChildren(
      ...this.search.elements(
        button('All', () => this.choose(true), { title: 'Choose all labels that match the search' }),
        button('None', () => this.choose(false), { title: 'Clear all labels that match the search' }),
      ),
    );
    this.search.fill();
    this.shown = isRenumbered(this.volume) ? null : lookOf(labels, (label) => this.chosen.has(label));
    this.onLook();
  }

  // The chosen labels, which slices and preview show. Null until labels are counted, and if samples do not tell them.
  look(): LabelLook | null {
    return this.shown;
  }

  // The triangles of each label's surface, from the estimate.
  showTriangles(triangles: ReadonlyMap<Label, number>): void {
    this.triangles = triangles;
    this.update();
  }

  // All that the search finds.
  private choose(isOn: boolean): void {
    for (const { label } of this.search?.found ?? []) {
      if (isOn) this.chosen.add(label);
      else this.chosen.delete(label);
    }
    this.changed();
  }

  private boxOf(label: VolumeLabel): Box {
    const known = this.boxes.get(label.label);
    if (known) return known;
    const check = checkbox(labelTitle(label), this.chosen.has(label.label), (isOn) => {
      if (isOn) this.chosen.add(label.label);
      else this.chosen.delete(label.label);
      this.changed();
    });
    const size = h('span.faint');
    const box = {
      element: h('li', { 'data-label': label.label }, swatchOf(colourOf(label)), h('div.label-text', check, size), [
        button('Show', () => this.onPlace(middleOf(label)), { class: 'quiet', 'aria-label': `Show ${labelTitle(label)} in the slices` }),
      ]),
      input: check.querySelector('input') as HTMLInputElement,
      size,
      voxels: label.voxels,
    };
    this.boxes.set(label.label, box);
    this.updateBox(label.label, box);
    return box;
  }

  private update(): void {
    for (const [label, box] of this.boxes) this.updateBox(label, box);
    this.search?.recount();
  }

  private updateBox(label: Label, { input, size, voxels }: Box): void {
    input.checked = this.chosen.has(label);
    const triangles = input.checked ? this.triangles.get(label) : undefined;
    size.textContent =
      `${formatCount(voxels)} voxels` + (triangles === undefined ? '' : `, ${formatCount(triangles)} triangles`);
  }

  private changed(): void {
    this.update();
    this.onChange({ labels: this.choice(), background: this.background });
  }

  // The chosen labels; undefined if there are none.
  choice(): Choice['labels'] {
    if (this.chosen.size === this.labels.length) return 'all';
    const [first, ...others] = this.labels.map(({ label }) => label).filter((label) => this.chosen.has(label));
    return first === undefined ? undefined : [first, ...others];
  }
}
