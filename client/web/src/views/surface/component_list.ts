// The connected components of a surface: a list with their sizes and places, to show and hide them at once, and one job of what is shown.
import type { Job, JobParameters, Vec3 } from '../../api/types';
import { HiddenParts } from '../../mesh/hidden_parts';
import type { PartFinder, PartSummary } from '../../mesh/part_finder';
import type { Picked } from '../../scene/picked';
import type { Surface } from '../../scene/surface';
import { isByLabels } from '../../job/table';
import type { MakeVariant } from '../../job/variants';
import { button, checkbox, h } from '../../ui/dom';
import { formatCount, formatSize, formatValue } from '../../ui/format';
import type { Scope } from '../../ui/signal';

const slice = 8; // milliseconds for one step of the search for components
const mostRows = 100;
// A job lists each component that it keeps.
const mostPlaces = 1000;

function placeOf(point: Vec3): Vec3 {
  return point.map((value) => Number(value.toPrecision(7))) as Vec3;
}

// The parameters that keep only the components at those points. Components that were dropped before stay dropped,
// because the nearest component to a point is one of those that are left.
export function keepOnlyAt(...points: Vec3[]): Partial<JobParameters> {
  return { components: { keep: null, min_triangles: null, nearest_to: points.map(placeOf) } };
}

export class ComponentList {
  // Null where a surface has only one, or is one of labels.
  readonly element: HTMLDetailsElement | null;
  // The clicked one.
  readonly picked = h('div.picked-part', { role: 'status', hidden: true });
  private readonly body = h('div', h('p.hint', { role: 'status' }, 'Looking for connected components'));
  private readonly rows = new Map<number, HTMLElement>();
  private readonly parts = new HiddenParts();
  private readonly summary = h('p.hint', { role: 'status' });
  private readonly make: HTMLButtonElement;
  private surface: Surface | null = null;
  private finding: Promise<PartFinder | null> | null = null;
  private asked = 0;

  constructor(
    private readonly scope: Scope,
    private readonly job: Job,
    makeVariant: MakeVariant,
  ) {
    const count = job.mesh?.components ?? 1;
    this.make = button('Make what is shown', () => makeVariant(keepOnlyAt(...this.parts.shown.map(({ point }) => point))), {
      title: 'Starts one job that drops all components that are hidden',
    });
    const isList = count > 1 && !isByLabels(job.parameters);
    this.element = isList ? h('details.panel-section.components', h('summary', h('h2', `${formatCount(count)} connected components`)), this.body) : null;
    this.element?.addEventListener('toggle', () => void this.find());
  }

  // All of the surface is there.
  loaded(surface: Surface): void {
    this.surface = surface;
    // Other triangles at the same places, whose components have other numbers.
    this.finding = null;
    this.parts.lose();
    this.picked.hidden = true;
    if (this.parts.numbers.size > 0 || this.element?.open) void this.find();
  }

  // Null for nowhere.
  async pick(picked: Picked | null): Promise<void> {
    this.asked += 1;
    const { asked } = this;
    const vertex = picked?.vertex;
    this.picked.hidden = !vertex || !this.element || !this.surface;
    if (!vertex || this.picked.hidden) return;
    this.picked.replaceChildren(h('span', `One of ${formatCount(this.job.mesh?.components ?? 0)} connected components`));
    const part = (await this.find())?.partOf(...vertex);
    if (!part || asked !== this.asked) return;
    this.picked.replaceChildren(
      h('span', `One of ${formatCount(this.parts.all.length)} connected components: ${this.sizeOf(part)}`),
      button('Show only this component', () => this.show((one) => one.number === part.number), { class: 'link' }),
      button('Hide this component', () => this.show((one) => one.number !== part.number && !this.parts.numbers.has(one.number)), { class: 'link' }),
    );
    for (const [number, row] of this.rows) row.toggleAttribute('aria-current', number === part.number);
    this.rows.get(part.number)?.setAttribute('aria-current', 'true');
  }

  private sizeOf({ volume, area, triangles }: PartSummary): string {
    const isClosed = this.job.mesh?.quality.encloses_volume ?? false;
    const enclosed = volume < 0 ? 'inside out, ' : `volume ${formatValue(volume)} mm\u00b3, `;
    return `${isClosed ? enclosed : ''}area ${formatValue(area)} mm\u00b2, ${formatCount(triangles)} triangles`;
  }

  // Some milliseconds at a time.
  private find(): Promise<PartFinder | null> {
    const finder = this.surface?.components.finder;
    if (!finder) return Promise.resolve(null);
    this.finding ??= new Promise((resolve) => {
      const step = (): void => {
        if (this.scope.isOver) return;
        // Another surface came meanwhile.
        if (finder !== this.surface?.components.finder) {
          resolve(null);
          return;
        }
        const until = performance.now() + slice;
        while (performance.now() < until) {
          if (finder.step()) continue;
          this.fill(finder.all);
          resolve(finder);
          return;
        }
        setTimeout(step);
      };
      step();
    });
    return this.finding;
  }

  private fill(all: readonly PartSummary[]): void {
    const { parts } = this;
    const wereHidden = parts.numbers.size > 0;
    parts.take(all);
    if (wereHidden) this.surface?.components.setHidden(parts.numbers);
    this.rows.clear();
    const listed = parts.all.slice(0, mostRows);
    for (const part of listed) this.rows.set(part.number, this.rowOf(part));
    const others = parts.all.length - listed.length;
    this.body.replaceChildren(
      h('div.label-tools', [
        button('All', () => this.show(() => true)),
        button('Largest only', () => this.show((part) => part === parts.all[0])),
        others > 0 && button('Listed only', () => this.show(({ number }) => this.rows.has(number)), { title: `Hides ${formatCount(others)} smaller components` }),
        this.make,
      ]),
      h('ul.labels', { 'aria-label': 'Connected components, the largest first' }, ...this.rows.values()),
      this.summary,
    );
    this.update();
  }

  private rowOf(part: PartSummary): HTMLElement {
    const at = part.point.map((value) => formatSize(value)).join(', ');
    const check = checkbox(
      `${this.sizeOf(part)}; at ${at} mm`,
      true,
      (isOn) => this.show(({ number }) => (number === part.number ? isOn : !this.parts.numbers.has(number))),
    );
    const row = h('li', check);
    const mark = (isOn: boolean) => () => {
      const { surface } = this;
      if (!this.parts.areFound) return;
      surface?.change(() => surface.components.mark(isOn && !this.parts.numbers.has(part.number) ? part.number : null));
    };
    for (const name of ['pointerenter', 'focusin']) row.addEventListener(name, mark(true));
    for (const name of ['pointerleave', 'focusout']) row.addEventListener(name, mark(false));
    return row;
  }

  private show(isShown: (part: PartSummary) => boolean): void {
    this.parts.show(isShown);
    const { surface } = this;
    // Until the components are found their numbers say nothing about what is drawn.
    if (this.parts.areFound) {
      surface?.change(() => {
        surface.components.mark(null);
        surface.components.setHidden(this.parts.numbers);
      });
    }
    this.update();
  }

  private update(): void {
    for (const [number, row] of this.rows) {
      const input = row.querySelector('input');
      if (input) input.checked = !this.parts.numbers.has(number);
    }
    const count = this.parts.all.length - this.parts.numbers.size;
    this.make.disabled = count === 0 || this.parts.numbers.size === 0 || count > mostPlaces;
    const tooMany = this.parts.numbers.size > 0 && count > mostPlaces ? `; a job keeps at most ${formatCount(mostPlaces)}` : '';
    const cut = this.parts.all.length > mostRows ? `; the largest ${formatCount(mostRows)} are listed` : '';
    this.summary.textContent = `${formatCount(count)} of ${formatCount(this.parts.all.length)} are shown${cut}${tooMany}`;
  }
}
