// A volume and the iso-value to be chosen in it: #/volumes/ID.
import { client } from '../../client';
import { asApiError, type ApiError } from '../../api/problem';
import type { Estimate, JobParameters, Vec3, Volume } from '../../api/types';
import { changed, defaultParameters, estimateQuery, jobRequest, parametersOfQuery, queryOfParameters } from '../../job/parameters';
import { kindOf, kinds, withKind, type Kind } from '../../job/kinds';
import { trianglesOf } from '../../job/labels';
import { isByLabels, withLabels } from '../../job/table';
import { button, choose, h, isBehindDialog, isTyping, segmented } from '../../ui/dom';
import { formatValue, shortened } from '../../ui/format';
import { History } from '../../ui/history';
import { refusal } from '../../ui/notices';
import { go, noteInAddress, type Route } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { cssColour, theme } from '../../ui/theme';
import { defaultWindow, type Histogram } from '../../volume/histogram';
import { SliceSource, textOfWindow, windowOfText, type Window } from '../../volume/slices';
import { boxOf, cropOf, isUpright, within, type Box } from '../../volume/crop';
import { cursorOfText } from '../../volume/geometry';
import { isCt } from '../../volume/looks';
import type { LabelLook } from '../../volume/label_map';
import { areLabels, eachLabel, isInteger, spanOf, volumeName } from '../../volume/names';
import { aboutVolume, notedOf, sliceHelp } from './about_volume';
import { CropControl } from './crop_control';
import { estimateTexts, simplifiedInWords } from './estimate_texts';
import { HistogramView } from './histogram_view';
import { IsoField } from './iso_field';
import { isoPresets } from './iso_presets';
import { LiveView } from './live_view';
import { LabelChoice, type Choice } from '../labels/label_choice';
import { madeSurfaces } from './made_surfaces';
import { parameterForm } from './parameter_form';
import { paneArea } from '../slices/pane_area';
import { looksInAddress, restoreLooks, sliceControls, watchLooks, WindowChoice } from '../slices/slice_looks';
import { SliceLayers } from '../slices/slice_layers';
import { ObliqueView } from '../slices/oblique_view';
import { SliceMeasures } from '../slices/slice_measure';
import { sliceProfile } from '../slices/slice_profile';
import { SliceView, type SliceHost } from '../slices/slice_view';

const mostBins = 1024;
const estimateDelay = 300;

export async function prepareView(scope: Scope, route: Route): Promise<HTMLElement> {
  const volume = await client.getVolume(route.path[1] ?? '');
  // A bin for each value where there are few: more bins would leave gaps between the values.
  const values = isInteger(volume) ? volume.range[1] - volume.range[0] + 1 : mostBins;
  const histogram = await client.histogramOf(volume.id, Math.min(mostBins, values), scope.signal);
  return new Prepare(scope, route, volume, histogram).element;
}

function startOfQuery(query: URLSearchParams, volume: Volume, defaults: JobParameters): JobParameters {
  const parameters = parametersOfQuery(query, defaults);
  // An iso-value makes one surface of all labels above it, which users rarely want.
  return areLabels(volume) && !query.has('iso') && !isByLabels(parameters) ? withLabels(parameters, 'all') : parameters;
}

class Prepare {
  readonly element: HTMLElement;
  private parameters: JobParameters;
  private readonly defaults: JobParameters;
  private window: Window;
  private cursor: Vec3;
  private readonly slices: SliceView[];
  private readonly measures: SliceMeasures;
  private readonly layers: SliceLayers;
  private readonly oblique: ObliqueView;
  private readonly histogram: HistogramView;
  private readonly live: LiveView;
  // Null where a box of the patient's axes is none of the volume's; then its corners are typed.
  private readonly crop: CropControl | null;
  private readonly isoField = new IsoField((iso) => this.takeIso(iso), (isGood) => this.mark('iso', isGood));
  private readonly estimate = h('div.estimate', { 'aria-live': 'polite' });
  private readonly run: HTMLButtonElement;
  private readonly isoPart: HTMLElement;
  private readonly labelPart = h('div');
  private readonly kind = h('div.kind');
  private labelChoice: LabelChoice | null = null;
  private hasLabel = true;
  // The controls in which something stands that is no value of theirs.
  private readonly faulty = new Set<string>();
  private readonly form = h('div');
  private readonly surfaceKind = segmented('Kind of surface', kinds, 'smooth', (kind) => this.setSurfaceKind(kind));
  private readonly simplified = h('p.hint', { 'aria-live': 'polite' });
  private readonly problem = h('div');
  private readonly windowText = h('span.window-text.faint');
  private readonly windowChoice: WindowChoice | null;
  private readonly resetWindow = h('button.chip', { type: 'button' }, 'Reset window');
  private estimating: AbortController | null = null;
  private estimateTimer = 0;
  private isStarting = false;
  private readonly history: History<JobParameters>;
  private readonly undoButton = button('Undo', () => this.goBack(this.history.undo()), { class: 'chip', title: 'Undo the last change (Ctrl Z)' });

  constructor(
    private readonly scope: Scope,
    route: Route,
    private readonly volume: Volume,
    counts: Histogram,
  ) {
    this.defaults = defaultParameters(volume.id, shortened(volume.suggested_iso, spanOf(volume)));
    this.parameters = startOfQuery(route.query, volume, this.defaults);
    this.history = new History(this.parameters);
    const common = defaultWindow(counts, volume.suggested_iso);
    this.window = windowOfText(route.query.get('window') ?? '') ?? common;
    this.windowChoice = isCt(volume) ? new WindowChoice(common, (window) => this.setWindow(window)) : null;
    this.cursor = cursorOfText(route.query.get('at') ?? '', volume);

    this.oblique = new ObliqueView({ volume, setCursor: (cursor) => this.setCursor(cursor), cursor: () => this.cursor, window: () => this.window }, scope);
    restoreLooks(route.query);
    this.measures = new SliceMeasures(route.query.get('measured') ?? '');
    const byLabels = (): boolean => isByLabels(this.parameters);
    this.layers = new SliceLayers({ volume, commonWindow: common, window: () => this.window, oblique: this.oblique, areLabels: byLabels, query: route.query }, scope);
    const host = this.sliceHost(common);
    this.histogram = new HistogramView(counts, isInteger(volume), (iso) => this.setIso(iso), scope);
    this.slices = (['axial', 'coronal', 'sagittal'] as const).map((plane) => new SliceView(plane, host, scope));
    this.live = this.liveView(route, host);
    this.crop = host.crop && new CropControl(volume, this.box, (box) => this.setBox(box), (isGood) => this.mark('crop', isGood));
    this.run = button('Make the surface', () => void this.start(), { class: 'primary' });
    this.isoPart = h('div.by-iso', this.isoRow(), this.histogram.element);
    this.element = this.layout(common, host);
    this.kind.append(this.kindChoice() ?? '');
    this.showKind();
    scope.onEnd(() => {
      clearTimeout(this.estimateTimer);
      this.estimating?.abort();
    });
    this.listenToPage();
    this.update();
    this.askForEstimate();
  }

  private sliceHost(commonWindow: Window): SliceHost {
    const { volume, scope } = this;
    return {
      volume,
      source: new SliceSource(volume, scope),
      commonWindow,
      state: () => ({
        iso: isByLabels(this.parameters) ? null : this.iso,
        labels: this.labelLook,
        window: this.window,
        cursor: this.cursor,
      }),
      setWindow: (window) => this.setWindow(window),
      setCursor: (cursor) => this.setCursor(cursor),
      setIso: (iso) => {
        if (!isByLabels(this.parameters)) this.setIso(iso);
      },
      contourColour: () => cssColour('--contour'),
      crop: isUpright(volume) ? { box: () => this.box, setBox: (box) => this.setBox(within(volume, box)) } : null,
      onError: (error) => this.sliceFailed(error),
      measures: this.measures,
      layers: this.layers,
      oblique: this.oblique,
    };
  }

  private liveView({ query }: Route, { volume, setCursor }: SliceHost): LiveView {
    const setLook = (look: string): void => noteInAddress({ look });
    return new LiveView({ volume, window: this.histogram.shown, setCursor, look: query.get('look') ?? '', setLook }, this.scope);
  }

  private listenToPage(): void {
    const { scope } = this;
    scope.onEnd(theme.subscribe(() => this.update()));
    const note = (): void => noteInAddress(this.slicesInAddress);
    watchLooks(scope, note);
    for (const { changes } of [this.measures, this.layers, this.oblique]) scope.onEnd(changes.subscribe(note));
    // Before what is pressed changes anything.
    scope.listen(window, 'pointerdown', () => this.history.hold(), { capture: true });
    for (const end of ['pointerup', 'pointercancel'] as const) scope.listen(window, end, () => this.history.release());
    scope.listen(window, 'keydown', (event: KeyboardEvent) => {
      if (isBehindDialog()) return;
      if (event.key === 'Enter' && (event.ctrlKey || event.metaKey)) void this.start();
      else if (event.key.toLowerCase() === 'z' && (event.ctrlKey || event.metaKey) && !isTyping(event)) {
        event.preventDefault();
        this.goBack(event.shiftKey ? this.history.redo() : this.history.undo());
      } else if (event.key === '[' && !isTyping(event)) this.histogram.element.focus();
      else if (event.key === 'Escape' && !isTyping(event)) this.measures.takeBack();
      else if (event.key === 'Delete' && !isTyping(event)) this.measures.clear();
    });
  }

  private get iso(): number {
    const { iso } = this.parameters;
    return typeof iso === 'number' ? iso : this.volume.suggested_iso;
  }

  // Null for a job at an iso-value, and until the labels are counted.
  private get labelLook(): LabelLook | null {
    return isByLabels(this.parameters) ? (this.labelChoice?.look() ?? null) : null;
  }

  private get box(): Box | null {
    return boxOf(this.volume, this.parameters.crop);
  }

  private setBox(box: Box | null): void {
    this.parameters = { ...this.parameters, crop: box ? cropOf(this.volume, box) : null };
    this.changed();
  }

  // The controls that are for an iso-value, or those for labels.
  private showKind(): void {
    const byLabels = isByLabels(this.parameters);
    this.isoPart.hidden = byLabels;
    this.labelPart.hidden = !byLabels;
    if (byLabels && !this.labelChoice) {
      this.labelChoice = new LabelChoice(this.scope, this.volume, this.parameters, (choice) => this.setLabels(choice), () => this.update(), (place) => this.setCursor(place));
      this.labelPart.append(this.labelChoice.element);
    }
    this.faulty.clear();
    if (this.isoField.isMarked && !byLabels) this.faulty.add('iso');
    const isOpen = this.form.querySelector('details')?.open ?? false;
    this.form.replaceChildren(
      parameterForm({
        job: () => this.parameters,
        set: (parameter, value) => {
          this.parameters = changed(this.parameters, parameter, value);
          this.changed();
        },
        mark: (parameter, isGood) => this.mark(parameter.name, isGood),
        slider: { spacing: this.volume.spacing, outcome: this.simplified },
        hides: this.crop ? ['crop'] : [],
      }, isOpen),
    );
  }

  private mark(name: string, isGood: boolean): void {
    if (isGood === !this.faulty.has(name)) return;
    if (isGood) this.faulty.delete(name);
    else this.faulty.add(name);
    this.changed();
  }

  // True if the entered values make a valid job.
  private get isReady(): boolean {
    return this.hasLabel && this.faulty.size === 0;
  }

  private setKind(kind: 'iso' | 'labels'): void {
    const isNone = kind === 'labels' && this.labelChoice !== null && this.labelChoice.choice() === undefined;
    this.hasLabel = !isNone;
    this.parameters = withLabels(this.parameters, kind === 'labels' ? (this.labelChoice?.choice() ?? 'all') : undefined);
    this.showKind();
    this.changed();
  }

  private setSurfaceKind(kind: Kind): void {
    this.parameters = withKind(this.parameters, kind, this.volume.spacing);
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
      { value: 'iso', label: 'One surface', title: 'One surface at the iso-value' },
      { value: 'labels', label: eachLabel, title: 'One surface around each label of a segmentation' },
    ] as const;
    return segmented('What to mesh', choices, isByLabels(this.parameters) ? 'labels' : 'iso', (kind) => this.setKind(kind));
  }

  private layout(common: Window, { source }: SliceHost): HTMLElement {
    const { volume } = this;
    const area = paneArea(this.scope, [...this.slices, { element: this.live.element, name: 'the preview' }, this.oblique]);
    const element = h('div.prepare', { 'data-title': volumeName(volume) }, [
      area,
      h('section.panel', { 'aria-label': 'Parameters' }, [
        aboutVolume(volume, () => (element.dataset.title = volumeName(volume))),
        this.kind,
        this.isoPart,
        this.labelPart,
        this.windowRow(common),
        sliceControls(this.windowChoice, this.measures),
        sliceProfile(volume, this.measures, source.exact, this.scope),
        this.layers.element,
        this.crop?.element ?? '',
        ...notedOf(volume),
        this.surfaceKind,
        this.form,
        madeSurfaces(volume.id),
        sliceHelp(),
        this.estimate,
        this.problem,
        h('div.run', this.run, h('span.hint.by-mouse', 'Ctrl + Enter')),
      ]),
    ]);
    return element;
  }

  // The window of the slices, and the way back to the usual one.
  private windowRow(common: Window): HTMLElement {
    this.resetWindow.addEventListener('click', () => this.setWindow(common));
    return h('div.window-row', this.windowText, h('span.grow'), this.undoButton, this.resetWindow);
  }

  private setCursor(cursor: Vec3): void {
    this.cursor = cursor;
    this.update();
  }

  private setWindow(window: Window): void {
    this.window = window;
    this.update();
  }

  private isoRow(): HTMLElement {
    return h('div.iso-row', this.isoField.element, isoPresets(this.volume, () => this.iso, (iso) => this.setIso(iso)));
  }

  private setIso(iso: number): void {
    this.isoField.replace(iso);
    this.takeIso(iso);
  }

  private takeIso(iso: number): void {
    this.parameters = { ...this.parameters, iso };
    this.changed();
  }

  // Null where there is nothing to go back to.
  private goBack(parameters: JobParameters | null): void {
    if (!parameters) return;
    this.parameters = parameters;
    // These keep what was chosen in them.
    this.labelChoice = null;
    this.labelPart.replaceChildren();
    this.isoField.replace(this.iso);
    this.kind.replaceChildren(this.kindChoice() ?? '');
    this.showKind();
    this.changed();
  }

  private changed(): void {
    this.history.change(this.parameters);
    this.run.disabled = !this.isReady || this.isStarting;
    this.update();
    if (this.isReady) this.askForEstimate();
    else this.showMissing(this.hasLabel ? 'Correct the marked fields.' : 'Choose at least one label.');
  }

  private showMissing(text: string): void {
    clearTimeout(this.estimateTimer);
    this.estimating?.abort();
    this.estimate.classList.remove('stale');
    this.estimate.replaceChildren(h('p.warning', text));
  }

  private update(): void {
    this.undoButton.hidden = !this.history.canUndo;
    choose(this.surfaceKind, kindOf(this.parameters));
    for (const view of [...this.slices, this.layers, this.oblique]) view.update();
    if (isByLabels(this.parameters)) this.live.showLabels(this.labelLook, this.cursor);
    else this.live.show(this.iso, this.parameters.inside === 'below', this.cursor);
    this.live.showCrop(this.box);
    this.crop?.show(this.box);
    this.histogram.show(this.iso, this.window);
    const [low, high] = this.window;
    // Labels are seen as they are.
    this.windowText.hidden = this.resetWindow.hidden = isByLabels(this.parameters);
    this.windowChoice?.show(this.window);
    this.windowText.textContent = `window ${formatValue(high - low)}, level ${formatValue((low + high) / 2, high - low)}`;
    this.isoField.show(this.iso);
    noteInAddress({
      ...queryOfParameters(this.parameters, this.defaults),
      window: textOfWindow(this.window),
      at: this.cursor.join(','),
      ...this.slicesInAddress,
    });
  }

  private get slicesInAddress(): Record<string, string> {
    return { ...looksInAddress(), ...this.layers.texts, measured: this.measures.text };
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
      client.estimateOf(estimateQuery(this.parameters), controller.signal).then(
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
    this.simplified.textContent = simplifiedInWords(estimate);
    this.estimate.replaceChildren(...estimateTexts(estimate, isByLabels(this.parameters)));
  }

  private showNoEstimate(error: ApiError): void {
    const [fault] = error.faults;
    const text = fault ? `${fault.field}: ${fault.message}` : error.detail;
    this.estimate.classList.remove('stale');
    this.estimate.replaceChildren(error.status === 404 ? '' : h('p.warning', text));
  }

  private async start(): Promise<void> {
    if (this.run.disabled) return;
    this.isStarting = true;
    this.run.disabled = true;
    this.problem.replaceChildren();
    try {
      const job = await client.submitJob(jobRequest(this.parameters));
      // A person who went elsewhere meanwhile is told when it has ended.
      if (!this.scope.isOver) go(['jobs', job.id]);
    } catch (error) {
      const failure = asApiError(error);
      this.problem.replaceChildren(refusal(failure, failure.isUnreachable && button('Try again', () => void this.start())));
      this.problem.scrollIntoView({ block: 'nearest' });
    } finally {
      this.isStarting = false;
      this.run.disabled = !this.isReady;
    }
  }
}
