// The parts of a surface that are hidden, also when the same surface comes with other triangles, whose parts have other numbers.
import { foundAnew, type PartSummary } from './part_finder';

export class HiddenParts {
  // The largest first; until others are found, those of the surface before.
  all: readonly PartSummary[] = [];
  // False while the numbers are not those of the surface that is there.
  areFound = false;
  private readonly hidden = new Set<number>();

  get numbers(): ReadonlySet<number> {
    return this.hidden;
  }

  get shown(): PartSummary[] {
    return this.all.filter(({ number }) => !this.hidden.has(number));
  }

  // Another surface is there, whose parts are to be found.
  lose(): void {
    this.areFound = false;
  }

  // The parts of the surface that is there. Those that are hidden at this moment stay hidden.
  take(all: readonly PartSummary[]): void {
    const hidden = this.all.filter(({ number }) => this.hidden.has(number));
    this.all = [...all].sort((a, b) => b.area - a.area);
    this.areFound = true;
    this.hide(foundAnew(hidden, this.all));
  }

  show(isShown: (part: PartSummary) => boolean): void {
    this.hide(this.all.filter((part) => !isShown(part)).map(({ number }) => number)); // before any is forgotten
  }

  private hide(numbers: readonly number[]): void {
    this.hidden.clear();
    for (const number of numbers) this.hidden.add(number);
  }
}
