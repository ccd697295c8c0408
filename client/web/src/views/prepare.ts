// A volume and the iso-value to be chosen in it: #/volumes/ID.
import { estimateOf, getVolume, histogramOf, listJobs, renameVolume, submitJob } from '../api/client';
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
} from '../job/parameters';
import { button, field, h, isTyping } from '../ui/dom';
import {
  formatBytes,
  formatCount,
  formatDims,
  formatIso,
  formatMilliseconds,
  formatNames,
  formatSpacing,
  formatValue,
} from '../ui/format';
import { askText, refusal, tellError } from '../ui/notices';
import { go, hashOf, noteInAddress, type Route } from '../ui/route';
import type { Scope } from '../ui/signal';
import { cssColour, theme } from '../ui/theme';
import { defaultWindow, type Histogram } from '../volume/histogram';
import { volumeName } from '../volume/names';
import { SliceSource, type Window } from '../volume/slices';
import { HistogramView } from './histogram_view';
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

// What of an upload was left out, because a person may miss it.
function ignoredNote({ ignored }: Volume): HTMLElement | null {
  if (ignored.length === 0) return null;
  return h(
    'details',
    { class: 'more' },
    h('summary', {}, ignored.length === 1 ? '1 file was left out' : `${ignored.length} files were left out`),
    h('ul', {}, ...ignored.map(({ name, reason }) => h('li', {}, h('b', {}, name), `: ${reason}`))),
  );
}

// What the server decided or corrected when it read the upload.
function notesOf({ notes }: Volume): HTMLElement | null {
  if (notes.length === 0) return null;
  return h(
    'ul',
    { class: 'notes', 'aria-label': 'Notes' },
    ...notes.map(({ code, detail }) => h('li', { 'data-note': code }, detail)),
  );
}

// The volume's name, which a person can change.
function nameHeading(volume: Volume): HTMLElement {
  const text = h('span', {}, volumeName(volume));
  const rename = async (): Promise<void> => {
    const name = await askText('Name of this volume', volume.name ?? '', 'Rename');
    if (name === null) return;
    try {
      volume.name = (await renameVolume(volume.id, name === '' ? null : name)).name;
      text.textContent = volumeName(volume);
    } catch (error) {
      tellError(error);
    }
  };
  return h('h1', {}, text, ' ', button('Rename', () => void rename(), { class: 'quiet' }));
}

function factsOf(volume: Volume): string {
  return [
    formatNames[volume.format] ?? volume.format,
    volume.modality,
    `${formatDims(volume.dims)}, ${volume.type}`,
    formatSpacing(volume.spacing),
    `values ${formatValue(volume.range[0])} to ${formatValue(volume.range[1])}`,
  ]
    .filter(Boolean)
    .join(' \u00b7 ');
}

function sliceHelp(): HTMLElement {
  return h(
    'ul',
    {},
    h('li', {}, h('b', {}, 'Drag'), ' in a slice: window and level'),
    h('li', { class: 'by-mouse' }, h('b', {}, 'Wheel'), ' or arrow keys: next slice'),
    h('li', { class: 'by-mouse' }, h('b', {}, 'Click'), ': the other slices go there'),
    h('li', { class: 'by-touch' }, h('b', {}, 'Slider'), ' below it: next slice'),
    h('li', { class: 'by-touch' }, h('b', {}, 'Tap'), ': the other slices go there'),
    h('li', {}, h('b', {}, 'Line in the histogram'), ': the iso-value', h('span', { class: 'by-mouse' }, '; arrow keys move it too')),
  );
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
  private readonly problem = h('div');
  private readonly surfaces = h('div', { class: 'made' });
  private readonly windowText = h('span', { class: 'window-text faint' });
  private estimating: AbortController | null = null;
  private estimateTimer = 0;

  constructor(
    scope: Scope,
    route: Route,
    private readonly volume: Volume,
    counts: Histogram,
  ) {
    this.defaults = defaultParameters(volume.id, volume.suggested_iso);
    this.parameters = parametersOfQuery(route.query, this.defaults);
    const common = defaultWindow(counts, volume.suggested_iso);
    this.window = windowOfQuery(route.query) ?? common;
    this.cursor = cursorOfQuery(route.query, volume);

    const host: SliceHost = {
      volume,
      source: new SliceSource(volume, scope.signal),
      commonWindow: common,
      state: () => ({ iso: this.iso, window: this.window, cursor: this.cursor }),
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
    this.element = this.layout(common);
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
    return iso === 'otsu' ? this.volume.suggested_iso : iso;
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
        this.isoRow(),
        this.histogram.element,
        parameterForm({
          job: () => this.parameters,
          set: (parameter, value) => {
            this.parameters = changed(this.parameters, parameter, value);
            this.changed();
          },
        }),
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
      nameHeading(volume),
      h('p', { class: 'facts' }, factsOf(volume)),
      notesOf(volume),
      ignoredNote(volume),
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
                h('a', { href: hashOf(['jobs', id]) }, `iso ${formatIso(parameters.iso)}`),
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
    this.update();
    this.askForEstimate();
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
        h('p', { class: 'warning' }, 'No sample boundary has this value: the surface would be empty.'),
      );
    }
    if (!estimate.fits) {
      this.estimate.append(
        h(
          'p',
          { class: 'warning' },
          `This needs ${formatBytes(estimate.memory_bytes)} of memory, more than a job may take. ` +
            'Choose an iso-value with fewer triangles.',
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
