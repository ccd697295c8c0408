// A volume and the iso-value to be chosen in it: #/volumes/ID.
import { estimateOf, getVolume, histogramOf, listJobs, submitJob } from '../api/client';
import { asApiError, type ApiError } from '../api/problem';
import type { Estimate, JobParameters, Vec3, Volume } from '../api/types';
import {
  changed,
  defaultParameters,
  estimateQuery,
  inWords,
  jobRequest,
  parametersOfQuery,
  queryOfParameters,
  surfaceInWords,
} from '../job/parameters';
import { trianglesOf } from '../job/labels';
import { isByLabels, withLabels } from '../job/table';
import { button, field, h, isTyping, segmented } from '../ui/dom';
import {
  formatBytes,
  formatCount,
  formatMilliseconds,
  formatNames,
  formatValue,
} from '../ui/format';
import { refusal, tellError } from '../ui/notices';
import { go, hashOf, noteInAddress, type Route } from '../ui/route';
import type { Scope } from '../ui/signal';
import { cssColour, theme } from '../ui/theme';
import { defaultWindow, type Histogram } from '../volume/histogram';
import { SliceSource, type Window } from '../volume/slices';
import { aboutVolume, sliceHelp } from './about_volume';
import { HistogramView } from './histogram_view';
import { LabelChoice, type Choice } from './label_choice';
import { parameterForm } from './parameter_form';
import { SliceView, type SliceHost } from './slice_view';

const mostBins = 1024;
const estimateDelay = 300;
const shownSurfaces = 3;

// NIfTI and DICOM scale whole samples to values that are not.
function isInteger({ type, range }: Volume): boolean {
  return !type.startsWith('float') && range.every(Number.isInteger);
}

function windowOfQuery(query: URLSearchParams): Window | null {
  const [low, high] = (query.get('window') ?? '').split(',').map(Number);
  return low !== undefined && high !== undefined && high > low ? [low, high] : null;
}

function cursorOfQuery(query: URLSearchParams, volume: Volume): Vec3 {
  const middle = volume.dims.map((count) => Math.floor(count / 2)) as Vec3;
  const given = (query.get('at') ?? '').split(',').map(Number);
  return middle.map((value, axis) => {
    const wanted = given.length === 3 ? given[axis] : undefined;
    const isThere = Number.isInteger(wanted) && (wanted as number) >= 0 && (wanted as number) < volume.dims[axis as 0];
    return isThere ? (wanted as number) : value;
  }) as Vec3;
}

export async function prepareView(scope: Scope, route: Route): Promise<HTMLElement> {
  const volume = await getVolume(route.path[1] ?? '');
  // A bin for each value where there are few: more bins would leave gaps between the values.
  const values = isInteger(volume) ? volume.range[1] - volume.range[0] + 1 : mostBins;
  const histogram = await histogramOf(volume.id, Math.min(mostBins, values), scope.signal);
  return new Prepare(scope, route, volume, histogram).element;
}

function startOfQuery(query: URLSearchParams, volume: Volume, defaults: JobParameters): JobParameters {
  const parameters = parametersOfQuery(query, defaults);
  // An iso-value makes one surface of all labels above it, which hardly anybody wants.
  const areLabels = isInteger(volume) && volume.notes.some(({ code }) => code === 'looks-like-labels');
  return areLabels && !query.has('iso') && !isByLabels(parameters) ? withLabels(parameters, 'all') : parameters;
}

class Prepare {
  readonly element: HTMLElement;
  private parameters: JobParameters;
  private readonly defaults: JobParameters;
  private window: Window;
  private cursor: Vec3;
  private readonly slices: SliceView[];
  private readonly histogram: HistogramView;
  private readonly isoInput: HTMLInputElement;
  private readonly estimate = h('div', { class: 'estimate', 'aria-live': 'polite' });
  private readonly run: HTMLButtonElement;
  private readonly isoPart: HTMLElement;
  private readonly labelPart = h('div');
  private labelChoice: LabelChoice | null = null;
  private hasLabel = true;
  private readonly form = h('div');
  private readonly problem = h('div');
  private readonly surfaces = h('div', { class: 'made' });
  private readonly windowText = h('span', { class: 'window-text faint' });
  private estimating: AbortController | null = null;
  private estimateTimer = 0;

  constructor(
    private readonly scope: Scope,
    route: Route,
    private readonly volume: Volume,
    counts: Histogram,
  ) {
    this.defaults = defaultParameters(volume.id, volume.suggested_iso);
    this.parameters = startOfQuery(route.query, volume, this.defaults);
    const common = defaultWindow(counts, volume.suggested_iso);
    this.window = windowOfQuery(route.query) ?? common;
    this.cursor = cursorOfQuery(route.query, volume);

    const host: SliceHost = {
      volume,
      source: new SliceSource(volume, scope.signal),
      commonWindow: common,
      state: () => ({
        iso: isByLabels(this.parameters) ? null : this.iso,
        window: this.window,
        cursor: this.cursor,
      }),
      setWindow: (window) => {
        this.window = window;
        this.update();
      },
      setCursor: (cursor) => {
        this.cursor = cursor;
        this.update();
      },
      contourColour: () => cssColour('--contour'),
      onError: (error) => this.sliceFailed(error),
    };
    this.histogram = new HistogramView(counts, isInteger(volume), (iso) => this.setIso(iso), scope);
    this.slices = (['axial', 'coronal', 'sagittal'] as const).map(
      (plane) => new SliceView(plane, host, scope),
    );
    this.isoInput = h('input', { type: 'number', step: 'any', id: 'iso', class: 'iso-input' });
    this.isoInput.addEventListener('input', () => {
      if (Number.isFinite(this.isoInput.valueAsNumber)) this.setIso(this.isoInput.valueAsNumber);
    });
    this.run = button('Make the surface', () => void this.start(), { class: 'primary' });
    this.isoPart = h('div', { class: 'by-iso' }, this.isoRow(), this.histogram.element);
    this.element = this.layout(common);
    this.showKind();
    this.showSurfaces();
    scope.onEnd(() => {
      clearTimeout(this.estimateTimer);
      this.estimating?.abort();
    });
    scope.onEnd(theme.subscribe(() => this.update()));
    scope.listen(window, 'keydown', (event: KeyboardEvent) => {
      if (event.key === 'Enter' && (event.ctrlKey || event.metaKey)) void this.start();
      else if (event.key === '[' && !isTyping(event)) this.histogram.element.focus();
    });
    this.update();
    this.askForEstimate();
  }

  private get iso(): number {
    const { iso } = this.parameters;
    return typeof iso === 'number' ? iso : this.volume.suggested_iso;
  }

  // The controls that are for an iso-value, or those for labels.
  private showKind(): void {
    const byLabels = isByLabels(this.parameters);
    this.isoPart.hidden = byLabels;
    this.labelPart.hidden = !byLabels;
    if (byLabels && !this.labelChoice) {
      this.labelChoice = new LabelChoice(this.scope, this.volume.id, this.parameters, (choice) => this.setLabels(choice));
      this.labelPart.append(this.labelChoice.element);
    }
    this.form.replaceChildren(
      parameterForm({
        job: () => this.parameters,
        set: (parameter, value) => {
          this.parameters = changed(this.parameters, parameter, value);
          this.changed();
        },
      }),
    );
  }

  private setKind(kind: 'iso' | 'labels'): void {
    const isNone = kind === 'labels' && this.labelChoice !== null && this.labelChoice.choice() === undefined;
    this.hasLabel = !isNone;
    this.parameters = withLabels(this.parameters, kind === 'labels' ? (this.labelChoice?.choice() ?? 'all') : undefined);
    this.showKind();
    this.changed();
  }

  // While no label is chosen nothing can be made.
  private setLabels({ labels, background }: Choice): void {
    this.hasLabel = labels !== undefined;
    this.parameters = { ...this.parameters, labels: labels ?? 'all', background };
    this.changed();
  }

  private kindChoice(): HTMLElement | null {
    if (!isInteger(this.volume)) return null;
    const choices = [
      { value: 'iso', label: 'One surface', title: 'Around all samples of the iso-value or more' },
      { value: 'labels', label: 'Each label', title: 'One surface around each label of a segmentation' },
    ] as const;
    return segmented('What to mesh', choices, isByLabels(this.parameters) ? 'labels' : 'iso', (kind) => this.setKind(kind));
  }

  private layout(common: Window): HTMLElement {
    return h(
      'div',
      { class: 'prepare' },
      h(
        'section',
        { class: 'slices', 'aria-label': 'Slices' },
        ...this.slices.map((view) => view.element),
        this.about(common),
      ),
      h(
        'section',
        { class: 'panel', 'aria-label': 'Parameters' },
        this.kindChoice(),
        this.isoPart,
        this.labelPart,
        this.form,
        this.estimate,
        this.problem,
        h('div', { class: 'run' }, this.run, h('span', { class: 'hint by-mouse' }, 'Ctrl + Enter')),
      ),
    );
  }

  // What stands beside the slices: the volume, how to move in it, and what was made of it.
  private about(common: Window): HTMLElement {
    const { volume } = this;
    const reset = button('Reset window', () => {
      this.window = common;
      this.update();
    });
    return h(
      'div',
      { class: 'slice-help' },
      ...aboutVolume(volume),
      sliceHelp(),
      h('div', { class: 'actions' }, reset, this.windowText),
      this.surfaces,
    );
  }

  private isoRow(): HTMLElement {
    const { suggested_iso: otsu, presets } = this.volume;
    const chips = [{ name: 'Otsu', iso: otsu }, ...presets].map(({ name, iso }) =>
      button(`${name} ${formatValue(iso)}`, () => this.setIso(iso), { class: 'chip' }),
    );
    return h(
      'div',
      { class: 'iso-row' },
      field('Iso-value', this.isoInput),
      h('div', { class: 'presets', role: 'group', 'aria-label': 'Presets' }, ...chips),
    );
  }

  // What was made of this volume lately, to go back to. Nothing is missed without it.
  private showSurfaces(): void {
    listJobs().then(
      ({ jobs }) => {
        const made = jobs.filter(({ volume, mesh }) => volume === this.volume.id && mesh).slice(0, shownSurfaces);
        if (made.length === 0) return;
        this.surfaces.replaceChildren(
          h('h2', {}, 'Surfaces of it'),
          h(
            'ul',
            {},
            ...made.map(({ id, parameters }) =>
              h(
                'li',
                {},
                h('a', { href: hashOf(['jobs', id]) }, surfaceInWords(parameters)),
                ` ${inWords(parameters)}`,
              ),
            ),
          ),
        );
      },
      () => undefined,
    );
  }

  private setIso(iso: number): void {
    this.parameters = { ...this.parameters, iso };
    this.changed();
  }

  private changed(): void {
    this.run.disabled = !this.hasLabel;
    this.update();
    if (this.hasLabel) this.askForEstimate();
    else this.showNoLabel();
  }

  private showNoLabel(): void {
    clearTimeout(this.estimateTimer);
    this.estimating?.abort();
    this.estimate.replaceChildren(h('p', { class: 'warning' }, 'Choose a label.'));
  }

  private update(): void {
    for (const view of this.slices) view.update();
    this.histogram.show(this.iso, this.window);
    const [low, high] = this.window;
    this.windowText.textContent = `window ${formatValue(high - low)}, level ${formatValue((low + high) / 2)}`;
    if (document.activeElement !== this.isoInput) this.isoInput.value = String(this.iso);
    noteInAddress({
      ...queryOfParameters(this.parameters, this.defaults),
      window: this.window.map((value) => Number(value.toPrecision(5))).join(','),
      at: this.cursor.join(','),
    });
  }

  private sliceFailed(error: unknown): void {
    const failure: ApiError = asApiError(error);
    if (!failure.isUnreachable) this.problem.replaceChildren(refusal(failure));
  }

  private askForEstimate(): void {
    clearTimeout(this.estimateTimer);
    this.estimating?.abort();
    this.estimate.classList.add('stale');
    this.estimateTimer = window.setTimeout(() => {
      const controller = new AbortController();
      this.estimating = controller;
      estimateOf(estimateQuery(this.parameters), controller.signal).then(
        (estimate) => this.showEstimate(estimate),
        (error: unknown) => {
          if (!controller.signal.aborted) this.showNoEstimate(asApiError(error));
        },
      );
    }, estimateDelay);
  }

  private showEstimate(estimate: Estimate): void {
    this.estimate.classList.remove('stale');
    this.labelChoice?.showTriangles(trianglesOf(estimate));
    const files = Object.entries(estimate.bytes).map(
      ([format, bytes]) => `${formatNames[format] ?? format} ${formatBytes(bytes)}`,
    );
    const rows: [string, string][] = [
      ['Triangles', formatCount(estimate.triangles)],
      ['Vertices', formatCount(estimate.vertices)],
      ['Files', `about ${files.join(', ')}`],
      ['Time', `about ${formatMilliseconds(estimate.milliseconds)}`],
    ];
    const before = estimate.queue.queued + estimate.queue.running;
    if (before > 0) rows.push(['Before it', before === 1 ? '1 job' : `${before} jobs`]);
    this.estimate.replaceChildren(
      h('dl', {}, ...rows.flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)])),
    );
    if (estimate.triangles === 0) {
      this.estimate.append(
        h(
          'p',
          { class: 'warning' },
          isByLabels(this.parameters)
            ? 'These labels have no boundary: the surface would be empty.'
            : 'No sample boundary has this value: the surface would be empty.',
        ),
      );
    }
    if (!estimate.fits) {
      this.estimate.append(
        h(
          'p',
          { class: 'warning' },
          `This needs ${formatBytes(estimate.memory_bytes)} of memory, more than a job may take. ` +
            (isByLabels(this.parameters) ? 'Choose fewer labels.' : 'Choose an iso-value with fewer triangles.'),
        ),
      );
    }
  }

  private showNoEstimate(error: ApiError): void {
    const [fault] = error.faults;
    const text = fault ? `${fault.field}: ${fault.message}` : error.detail;
    this.estimate.classList.remove('stale');
    this.estimate.replaceChildren(
      error.status === 404 ? '' : h('p', { class: 'warning' }, text),
    );
  }

  private async start(): Promise<void> {
    if (this.run.disabled) return;
    this.run.disabled = true;
    this.problem.replaceChildren();
    try {
      const job = await submitJob(jobRequest(this.parameters));
      go(['jobs', job.id]);
    } catch (error) {
      const failure = asApiError(error);
      this.problem.replaceChildren(refusal(failure));
      if (failure.isUnreachable) tellError(failure);
    } finally {
      this.run.disabled = false;
    }
  }
}
