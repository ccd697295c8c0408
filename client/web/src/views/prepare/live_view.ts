// The surface at the iso-value, beside the slices and as it changes: drawn from a reduced copy of the volume.
import { onReconnect } from '../../client';
import { delayAfter } from '../../api/busy';
import { asApiError } from '../../api/problem';
import type { Vec3, Volume } from '../../api/types';
import { graphicsStarted } from '../../scene/graphics';
import type { LiveSurface } from '../../scene/live';
import { h } from '../../ui/dom';
import { formatValue } from '../../ui/format';
import type { Scope } from '../../ui/signal';
import { toPatient } from '../../volume/geometry';
import type { Box } from '../../volume/crop';
import { coloursOf, LabelMap, mostInBytes, type LabelLook } from '../../volume/label_map';
import { lookOf, looksFor, type LookName } from '../../volume/looks';
import type { Preview } from '../../volume/preview';
import { fetchLabelPreview, fetchPreview, largestPreview } from '../../volume/preview_file';
import type { Window } from '../../volume/slices';

// Samples along an axis: what is there soon, and what is drawn then.
const firstSize = 64;
const softwareSize = 128;
const retryDelay = 3000;
const turnStep = Math.PI / 24;

export interface LiveHost {
  volume: Volume;
  // The usual range of iso-values.
  window: Window;
  setCursor: (cursor: Vec3) => void;
  // How the volume is looked through; '' for its surface.
  look: string;
  setLook: (look: LookName | '') => void;
}

// As many of them as eight bits can number.
function inBytes(map: LabelMap): LabelMap {
  return map.labels.length <= mostInBytes ? map : new LabelMap(map.labels.slice(0, mostInBytes));
}

export class LiveView {
  readonly element: HTMLElement;
  private readonly view = h('div.live-picture');
  private readonly state = h('p.slice-state', { role: 'status' });
  private readonly place = h('span.live-place');
  private surface: LiveSurface | null = null;
  private preview: Preview | null = null;
  private iso: number | null = null;
  private isBelow = false;
  private cursor: Vec3 = [0, 0, 0];
  // What is fetched: a window, or the key of a map of labels.
  private wanted = '';
  private window: Window | null = null;
  private labels: LabelLook | null = null;
  private loading: AbortController | null = null;
  private retry = 0;
  private hasFailed = false;
  private look: LookName | '' = '';
  private readonly choice: HTMLElement;
  private box: Box | null = null;

  constructor(
    private readonly host: LiveHost,
    private readonly scope: Scope,
  ) {
    this.choice = this.lookChoice();
    this.element = h('figure.slice.live', [
      h('div.slice-picture', this.view, this.state),
      h('figcaption', this.choice, this.place),
    ]);
    scope.onEnd(() => {
      clearTimeout(this.retry);
      this.loading?.abort();
      this.surface?.dispose();
    });
    onReconnect(scope, () => this.hasFailed && this.load());
  }

  private lookChoice(): HTMLElement {
    const names = looksFor(this.host.volume);
    this.look = names.find((name) => name === this.host.look) ?? '';
    const choice = h('select.look', { 'aria-label': 'Kind of preview', title: 'The surface at the iso-value, or volume rendering' }, [
      h('option', { value: '' }, 'Surface'),
      h('optgroup', { label: 'Volume rendering' }, [
        ...names.map((name) => h('option', { value: name, selected: name === this.look }, name.charAt(0).toUpperCase() + name.slice(1))),
      ]),
    ]);
    choice.addEventListener('change', () => {
      this.look = choice.value as LookName | '';
      this.host.setLook(this.look);
      this.showLook();
    });
    return choice;
  }

  private showLook(): void {
    const { look, preview, labels } = this;
    if (!preview) return;
    if (labels) this.surface?.setLabels(coloursOf(labels));
    else this.surface?.setLook(look === '' ? null : lookOf(look, preview.window));
    this.element.dataset.look = look;
  }

  // In samples of the volume; null for all of it.
  showCrop(box: Box | null): void {
    this.box = box;
    const { dims } = this.host.volume;
    const parts = (corner: Vec3): Vec3 => corner.map((value, axis) => value / Math.max(1, dims[axis as 0] - 1)) as Vec3;
    this.surface?.setCrop(box && [parts(box[0]), parts(box[1])]);
  }

  // The labels of a segmentation; null while they are counted. The cursor is where the slices meet.
  showLabels(look: LabelLook | null, cursor: Vec3): void {
    this.choice.hidden = true;
    this.cursor = cursor;
    const isTooLarge = this.host.volume.dims.some((count) => count > largestPreview);
    this.view.hidden = look === null || isTooLarge;
    if (!look || isTooLarge) {
      this.say(isTooLarge ? `The preview shows labels of volumes with at most ${largestPreview} samples along each axis.` : '');
      return;
    }
    this.iso = null;
    this.labels = { ...look, map: this.wanted === look.map.key && this.labels ? this.labels.map : inBytes(look.map) };
    this.want(look.map.key);
    this.showPlace('Preview of the labels');
    if (this.preview && Number.isNaN(this.preview.window[0])) this.showLook();
  }

  private want(key: string): void {
    if (key === this.wanted) {
      if (!this.hasFailed) this.say('');
      return;
    }
    this.wanted = key;
    this.load();
  }

  // The surface at that iso-value, with lower values inside if it is below. The cursor is where the slices meet.
  show(iso: number, isBelow: boolean, cursor: Vec3): void {
    this.choice.hidden = false;
    this.labels = null;
    this.iso = iso;
    this.isBelow = isBelow;
    this.cursor = cursor;
    this.view.hidden = false;
    const window = this.windowFor(iso);
    if (!window) {
      this.say('There is no surface: the iso-value is not between the smallest and the largest sample.');
      this.view.hidden = true;
      return;
    }
    this.window = window;
    this.want(window.join());
    this.showIso();
  }

  // The range that eight bits cover: the usual range of iso-values, or all values if the iso-value lies outside it.
  private windowFor(iso: number): Window | null {
    const { window, volume } = this.host;
    if (iso > window[0] && iso <= window[1]) return window;
    const [low, high] = volume.range;
    return iso > low && iso <= high ? [low, high] : null;
  }

  private showIso(): void {
    if (!this.surface || !this.preview || this.iso === null || Number.isNaN(this.preview.window[0])) return;
    this.showPlace(`Preview of the surface at iso-value ${formatValue(this.iso, this.host.window[1] - this.host.window[0])}`);
    this.surface.setIso(this.iso, this.isBelow);
  }

  private showPlace(name: string): void {
    this.surface?.canvas.setAttribute('aria-label', `${name}. Drag or use the arrow keys to turn it.`);
    this.surface?.setCursor(toPatient(this.host.volume, this.cursor));
  }

  private say(text: string): void {
    if (this.state.textContent !== text) this.state.textContent = text;
  }

  private load(): void {
    clearTimeout(this.retry);
    this.loading?.abort();
    const loading = new AbortController();
    this.loading = loading;
    this.hasFailed = false;
    this.run(loading.signal).catch((error: unknown) => {
      if (loading.signal.aborted) return;
      this.hasFailed = true;
      const failure = asApiError(error);
      this.say(`The preview could not be loaded${failure.isUnreachable ? '' : `: ${failure.detail}`}`);
      this.retry = window.setTimeout(() => this.load(), delayAfter(failure, retryDelay));
    });
  }

  private async run(signal: AbortSignal): Promise<void> {
    if (!this.preview) this.say('Loading the preview');
    const { labels } = this;
    const [first, { LiveSurface }] = await Promise.all([
      labels ? fetchLabelPreview(this.host.volume.id, labels.map, signal) : this.fetch(firstSize, signal),
      import('../../scene/live'),
      graphicsStarted(),
    ]);
    if (signal.aborted) return;
    try {
      this.surface ??= this.begin(new LiveSurface(this.view));
    } catch {
      this.say('This browser cannot draw in 3D (WebGL 2 is missing or off).');
      return;
    }
    this.say('');
    this.take(first);
    const size = this.surface.isSoftware ? softwareSize : largestPreview;
    if (labels || this.host.volume.dims.every((count) => count <= firstSize)) return;
    this.take(await this.fetch(size, signal));
  }

  private fetch(size: number, signal: AbortSignal): Promise<Preview> {
    const { window } = this;
    if (!window) throw new Error('There is no window.');
    return fetchPreview(this.host.volume.id, size, window, signal);
  }

  private begin(surface: LiveSurface): LiveSurface {
    surface.onFrame = ({ took, scale, isResting, iso }) => {
      this.element.dataset.iso = String(iso);
      this.element.dataset.took = took.toFixed(1);
      this.element.dataset.scale = String(scale);
      // Pictures while something moves, and when it rests.
      const kind = isResting ? 'resting' : 'moving';
      this.element.dataset[kind] = String(Number(this.element.dataset[kind] ?? 0) + 1);
    };
    surface.onPick = (place) => this.host.setCursor(this.inVolume(place));
    this.scope.listen(surface.canvas, 'keydown', (event: KeyboardEvent) => this.moveKey(event, surface));
    return surface;
  }

  private take(preview: Preview): void {
    this.preview = preview;
    this.surface?.setPreview(preview);
    this.showIso();
    if (this.labels) this.showPlace('Preview of the labels');
    this.showLook();
    this.showCrop(this.box);
    this.element.dataset.size = String(Math.max(...preview.dims));
    const coarseness = Math.max(...this.factors(preview));
    this.place.textContent = coarseness > 1 ? `preview, 1 : ${coarseness}` : 'preview';
  }

  // How many samples of the volume are one of the preview's, along each axis.
  private factors({ steps }: Preview): Vec3 {
    return steps.map((step, axis) => Math.round(Math.hypot(...step) / this.host.volume.spacing[axis as 0])) as Vec3;
  }

  private inVolume(place: Vec3): Vec3 {
    if (!this.preview) return place;
    const factors = this.factors(this.preview);
    return place.map((value, axis) => {
      const factor = factors[axis as 0];
      const index = Math.round(value * factor + (factor - 1) / 2);
      return Math.max(0, Math.min(this.host.volume.dims[axis as 0] - 1, index));
    }) as Vec3;
  }

  private moveKey(event: KeyboardEvent, surface: LiveSurface): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const moves: Record<string, [number, number, number?]> = {
      ArrowLeft: [-turnStep, 0],
      ArrowRight: [turnStep, 0],
      ArrowUp: [0, turnStep],
      ArrowDown: [0, -turnStep],
      '+': [0, 0, 1 / 1.15],
      '=': [0, 0, 1 / 1.15],
      '-': [0, 0, 1.15],
    };
    const move = moves[event.key];
    if (!move) return;
    surface.turn(...move);
    event.preventDefault();
  }
}
