// The labels of a surface beside it: to be found, hidden, isolated, coloured and downloaded.
import type { Job, JobParameters, LabelSummary, MeshFormat, Volume, Label } from '../../api/types';
import { enclosesVolume, labelOrders, labelsCsv, labelTitle, type LabelOrder, type LabelState } from '../../job/labels';
import { holdsAllLabels, meshFormats } from '../../job/table';
import { fileNameOf, makeVariant, saveVariant } from '../../job/variants';
import { button, checkbox, h, select } from '../../ui/dom';
import { formatCount, formatValue, meshFileSuffix, meshFormatTitle } from '../../ui/format';
import { tell, tellError } from '../../ui/notices';
import { saveBlob, saveFile } from '../../ui/save';
import type { Scope } from '../../ui/signal';
import { opacityControl } from './label_opacity';
import { LabelSearch } from './label_search';
import { wallTable } from './wall_table';

export function volumeText(label: LabelSummary): string {
  const { closed, oriented, volume_mm3: volume } = label;
  if (enclosesVolume(label)) return `${formatValue(volume)} mm\u00b3`;
  if (!closed) return 'none (open)';
  return oriented ? 'none (inside out)' : 'none (not oriented)';
}

export function areaText({ area_mm2: area }: LabelSummary): string {
  return `${formatValue(area)} mm\u00b2`;
}

const noneShown = 'No label is shown. Show those that you want.';

interface Row {
  element: HTMLElement;
  shown: HTMLInputElement;
  colour: HTMLInputElement;
  alone: HTMLButtonElement;
}

export class LabelList {
  readonly element: HTMLElement;
  private readonly rows = new Map<Label, Row>();

  constructor(
    scope: Scope,
    private readonly job: Job,
    private readonly state: LabelState,
    private readonly volume: Volume | null,
  ) {
    const { labels } = state;
    const search = new LabelSearch(
      labels,
      (label) => this.rowOf(label).element,
      (found) => `${formatCount(found)} of ${formatCount(labels.length)} labels`,
    );
    this.element = h('section.panel-section.label-list', [
      h('h2', 'Labels'),
      ...search.elements(
        button('Show all', () => state.showAll(), { title: 'Show every label (e)' }),
        button('Hide all', () => state.hideAll()),
      ),
      h('div.label-table', [
        select(
          Object.entries(labelOrders).map(([name, [title]]) => [name as LabelOrder, title] as const),
          'value',
          (name) => search.sort(labelOrders[name][1]),
          { 'aria-label': 'Order of the labels' },
        ),
        this.saveAs('Save what is shown as', (format) => {
          const file = state.hidden.value.size === 0 ? job.mesh?.files[format] : undefined;
          const [only, ...others] = labels.filter(({ label }) => state.isShown(label));
          if (!only) return tell(noneShown);
          if (file) void saveFile(file.href, fileNameOf(job, volume, `.${meshFileSuffix(format)}`), file.bytes).catch(tellError);
          else if (others.length === 0) this.saveLabel(only, format);
          else void saveVariant(job, volume, format, this.shown ?? {});
        }),
        button('Make what is shown', () => (this.shown ? makeVariant(job)(this.shown) : tell(noneShown)), { title: 'Starts a job of the labels that are shown, in all its formats' }),
        button('Save as CSV', () => this.saveTable(), { title: 'Saves a table of all labels: voxels, volumes, areas, components' }),
      ]),
    ]);
    this.element.append(opacityControl(), ...wallTable(scope, job, search));
    search.fill();
    scope.onEnd(state.hidden.subscribe(() => this.update()));
    scope.onEnd(state.colours.subscribe(() => this.update()));
    scope.onEnd(state.picked.subscribe((picked) => this.markPicked(picked)));
  }

  // The changes that make a job one of the labels that are shown; none where all are. Null: no label is shown.
  private get shown(): Partial<JobParameters> | null {
    const [first, ...others] = this.state.labels.map(({ label }) => label).filter((label) => this.state.isShown(label));
    if (first === undefined) return null;
    return others.length + 1 === this.state.labels.length ? {} : { labels: [first, ...others] };
  }

  private rowOf(label: LabelSummary): Row {
    const known = this.rows.get(label.label);
    if (known) return known;
    const title = labelTitle(label);
    const check = checkbox(
      title,
      true,
      (isOn) => this.state.show(label.label, isOn),
      { 'aria-label': `Show ${title}` },
    );
    const shown = check.querySelector('input') as HTMLInputElement;
    const colour = h('input', { type: 'color', 'aria-label': `Colour of ${title}`, title: 'Colour' });
    colour.addEventListener('input', () => this.state.setColour(label.label, colour.value));
    const isolate = (): void => {
      this.state.isolate(label.label);
      // Says its area too, to whoever has no pointer.
      this.state.pick(label.label);
      this.state.chosen.value = label.label;
    };
    const alone = button('Only', isolate, {
      class: 'quiet',
      'aria-label': `Show only ${title}`,
      'aria-pressed': 'false',
      title: 'Hide all other labels',
    });
    const row = {
      element: h('li', { 'data-label': label.label }, [
        colour,
        h('div.label-text', [
          check,
          h('span.faint', `volume ${volumeText(label)}, of its voxels ${formatValue(label.voxels_mm3)} mm\u00b3; area ${areaText(label)}`),
          h('span.faint', `${formatCount(label.components)} ${label.components === 1 ? 'component' : 'components'}, ${formatCount(label.triangles)} triangles`),
        ]),
        alone,
        this.download(label, title),
      ]),
      shown,
      colour,
      alone,
    };
    this.rows.set(label.label, row);
    this.updateRow(label.label, row);
    return row;
  }

  private saveTable(): void {
    const text = labelsCsv(this.state.labels, this.state.colours.value);
    saveBlob(new Blob([text], { type: 'text/csv' }), fileNameOf(this.job, this.volume, '-labels.csv'));
  }

  // A choice of all formats.
  private saveAs(title: string, onFormat: (format: MeshFormat) => void): HTMLSelectElement {
    const element: HTMLSelectElement = select([['', title], ...meshFormats.map((format) => [format, meshFormatTitle(format)] as const)], '', (format) => {
      element.value = '';
      if (format !== '') onFormat(format);
    }, { 'aria-label': title });
    return element;
  }

  private saveLabel({ label, files = {} }: LabelSummary, format: MeshFormat): void {
    const file = files[format];
    if (file) void saveFile(file.href, fileNameOf(this.job, this.volume, `-${label}.${meshFileSuffix(format)}`), file.bytes).catch(tellError);
    // A label with a file of its own has the surface that is seen, with its walls to the others.
    else void saveVariant(this.job, this.volume, format, holdsAllLabels(format) && this.state.labels.length > 1 ? { labels: [label] } : {}, label);
  }

  private download(label: LabelSummary, title: string): HTMLElement {
    const element = this.saveAs('Save', (format) => this.saveLabel(label, format));
    element.setAttribute('aria-label', `Save ${title} as`);
    return element;
  }

  private update(): void {
    for (const [label, row] of this.rows) this.updateRow(label, row);
  }

  private updateRow(label: Label, { shown, colour, alone }: Row): void {
    shown.checked = this.state.isShown(label);
    alone.setAttribute('aria-pressed', String(this.state.isAlone(label)));
    const now = this.state.colours.value.get(label);
    if (now !== undefined) colour.value = now;
  }

  // Scrolls the list alone: scrollIntoView would take the surface that was tapped off a phone's screen.
  private scrollTo(row: HTMLElement): void {
    const list = row.parentElement;
    if (!list) return;
    const [outer, inner] = [list.getBoundingClientRect(), row.getBoundingClientRect()];
    if (inner.top < outer.top) list.scrollTop -= outer.top - inner.top;
    else if (inner.bottom > outer.bottom) list.scrollTop += inner.bottom - outer.bottom;
  }

  private markPicked(picked: LabelSummary | null): void {
    for (const [label, { element }] of this.rows) {
      if (label === picked?.label) {
        element.setAttribute('aria-current', 'true');
        this.scrollTo(element);
      } else element.removeAttribute('aria-current');
    }
  }
}
