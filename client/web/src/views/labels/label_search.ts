// The list of labels with a box to search it: those that are found, as rows that are made once.
import { matching, type Named } from '../../job/labels';
import { h, type Child } from '../../ui/dom';
import { formatCount } from '../../ui/format';

// More rows than these a person searches.
const mostRows = 500;

// Not an attribute, which the content policy would not take.
export function swatchOf(colour: string): HTMLElement {
  const swatch = h('span.swatch', { 'aria-hidden': 'true' });
  swatch.style.backgroundColor = colour;
  return swatch;
}

export class LabelSearch<Label extends Named> {
  readonly list = h('ul.labels', { 'aria-label': 'Labels' });
  readonly count = h('p.hint', { role: 'status' });
  readonly input = h('input', { type: 'search', placeholder: 'Name or value', 'aria-label': 'Search the labels' });

  private order: (a: Label, b: Label) => number = () => 0;

  // `rowOf` gives a label's row, the same one each time; `summary` says in words how many there are, of which so many
  // were found.
  constructor(
    private readonly labels: readonly Label[],
    private readonly rowOf: (label: Label) => HTMLElement,
    private readonly summary: (found: number) => string,
  ) {
    this.input.addEventListener('input', () => this.fill());
  }

  // The box with what is done to all that is found, the rows, and how many there are.
  elements(...tools: Child[]): HTMLElement[] {
    return [h('div.label-tools', this.input, ...tools), this.list, this.count];
  }

  get found(): readonly Label[] {
    return matching(this.labels, this.input.value).sort(this.order);
  }

  sort(order: (a: Label, b: Label) => number): void {
    this.order = order;
    this.fill();
  }

  fill(): void {
    this.list.replaceChildren(...this.found.slice(0, mostRows).map(this.rowOf));
    this.recount();
  }

  // When what the summary says has changed.
  recount(): void {
    const found = this.found.length;
    const isCut = found > mostRows;
    this.count.textContent = this.summary(found) + (isCut ? `; the first ${formatCount(mostRows)} are listed` : '');
  }
}
