// Layers of slices beside their own samples: another volume over them, and a projection of the slab around them.
import { client, onReconnect } from '../../client';
import type { Axis, Vec3, Volume } from '../../api/types';
import { isRenumbered, labelTitle } from '../../job/labels';
import { checkbox, field, h, select } from '../../ui/dom';
import { formatCount } from '../../ui/format';
import { tell, tellError } from '../../ui/notices';
import { imageOf, paintImage } from '../../ui/pixels';
import { Signal, type Scope } from '../../ui/signal';
import { defaultWindow } from '../../volume/histogram';
import { toPatient } from '../../volume/geometry';
import { lookOf, mostInBytes, type LabelLook } from '../../volume/label_map';
import { areLabels, volumeName } from '../../volume/names';
import type { Preview } from '../../volume/preview';
import { fetchLabelPreview, fetchPreview, largestPreview } from '../../volume/preview_file';
import { PreviewLoader } from '../../volume/preview_loader';
import { nearestValue, resliced, type Slab } from '../../volume/reslice';
import { windowToFetch, type Slice, type Window } from '../../volume/slices';
import { labelImage } from '../labels/label_opacity';
import type { ObliqueView } from './oblique_view';
import { pixelsOf } from './slice_looks';
import { slabOfText, slabToText, thicknesses } from './slice_texts';

const bins = 256;
// Volumes that can be laid over. The first page comes at once, the others when somebody is about to choose.
const mostListed = 5000;
const perPage = 1000;
// The lowest of 255 values fade out, so that air around a body does not darken the other volume.
const fading = 48;
// Up to yellow: what is white could be either volume.
const hottest = 2 / 3;
const hot = pixelsOf('hot').map((_, value, colours) => {
  const alpha = Math.round(255 * Math.min(1, value / fading));
  return (((colours[Math.round(hottest * value)] ?? 0) & 0xff_ffff) | (alpha << 24)) >>> 0;
});

interface Layer {
  volume: Volume;
  // Values, or the numbers of labels.
  preview: Preview;
  labels: LabelLook | null;
}

// Keeps what was made last for each axis.
class Kept<T> {
  private readonly made = new Map<Axis, { key: string; value: T }>();

  get(axis: Axis, key: string, make: () => T): T {
    const known = this.made.get(axis);
    if (known?.key === key) return known.value;
    const value = make();
    this.made.set(axis, { key, value });
    return value;
  }
}

export interface LayersHost {
  volume: Volume;
  commonWindow: Window;
  // As it is shown now.
  window: () => Window;
  oblique: ObliqueView;
  // Numbers of labels are no values: they have no maximum, no mean, and nothing between them.
  areLabels: () => boolean;
  // The query of the address.
  query: URLSearchParams;
}

const notForLabels = 'Only for one surface: numbers of labels have no maximum or mean, and none between samples';

export class SliceLayers {
  readonly element: HTMLElement;
  // They are to be drawn anew.
  readonly changes = new Signal(0);
  private other: Layer | null = null;
  private readonly own: PreviewLoader;
  private slab: Slab | null;
  private showsOblique: boolean;
  private wereLabels = false;
  // Are for values.
  private readonly valueControls: HTMLElement[];
  private readonly choice = h('select', h('option', { value: '' }, 'No overlay'));
  private next: string | null = null;
  private isListing = false;
  private readonly opacity = h('input', { type: 'range', min: 0, max: 1, step: 0.05, value: 0.5, 'aria-label': 'Opacity of the overlay' });
  private readonly overlays = new Kept<HTMLCanvasElement>();
  private readonly projections = new Kept<Slice>();
  private wanted = new AbortController();

  constructor(
    private readonly host: LayersHost,
    private readonly scope: Scope,
  ) {
    this.own = new PreviewLoader({
      fetch: (window) => fetchPreview(host.volume.id, largestPreview, window, scope.signal),
      onChange: () => this.showOwn(),
      onError: (error) => {
        if (!scope.isOver) tellError(error);
      },
    });
    scope.onEnd(() => this.wanted.abort());
    onReconnect(scope, () => this.own.retry());
    this.slab = slabOfText(host.query.get('slab') ?? '');
    this.showsOblique = host.oblique.restore(host.query.get('oblique') ?? '');
    this.opacity.hidden = true;
    this.opacity.addEventListener('input', () => this.changed());
    this.choice.addEventListener('change', () => void this.show(this.choice.value).catch(tellError));
    const over = field('Overlay', this.choice);
    over.append(this.opacity);
    over.hidden = true;
    for (const name of ['pointerenter', 'focus']) this.choice.addEventListener(name, () => void this.listOlder().catch(tellError));
    const slabControls = this.slabControls();
    const obliqueControl = this.obliqueControl();
    this.valueControls = [...slabControls, obliqueControl];
    this.element = h('div.stack', h('div.row.slice-layers', over, ...slabControls), obliqueControl);
    // Without the list nothing can be laid over, and everything else works.
    void this.list().then((hasSome) => (over.hidden = !hasSome), () => undefined);
  }

  // A preview does not tell apart the values beyond its window, so another window may need another preview.
  update(): void {
    this.showKind();
    if (this.host.areLabels() || (!this.slab && !this.showsOblique)) return;
    const [low, high] = this.host.window();
    this.own.want(windowToFetch([low, high], (low + high) / 2, this.host.commonWindow));
  }

  // For the address.
  get texts(): { slab: string; oblique: string } {
    return { slab: slabToText(this.slab), oblique: this.showsOblique ? this.host.oblique.text : '' };
  }

  // A projection instead of that slice; null where none is wanted or there.
  projected(axis: Axis, index: number): Slice | null {
    const { slab } = this;
    const { volume } = this.host;
    const own = this.own.preview;
    if (!own || !slab || this.host.areLabels()) return null;
    return this.projections.get(axis, [index, slabToText(slab), ...own.window].join(), () => ({ axis, index, ...resliced(own, volume, axis, index, slab), window: own.window }));
  }

  // Draws the other volume over that slice, in whose samples the context counts.
  paint(context: CanvasRenderingContext2D, axis: Axis, index: number): void {
    const { other } = this;
    const { volume } = this.host;
    if (!other) return;
    const before = context.globalAlpha;
    context.globalAlpha *= this.opacity.valueAsNumber;
    const picture = this.overlays.get(axis, [other.volume.id, index].join(), () => {
      const canvas = h('canvas');
      const { preview, labels } = other;
      const values = resliced(preview, volume, axis, index, null, labels !== null);
      paintImage(canvas, labels ? labelImage({ ...values, labels: values.values }, labels, 1) : imageOf(values, hot));
      return canvas;
    });
    context.imageSmoothingEnabled &&= other.labels === null;
    context.drawImage(picture, 0, 0);
    context.globalAlpha = before;
  }

  // The label of the other volume at that place; '' for none.
  labelAt(place: Vec3): string {
    if (!this.other?.labels) return '';
    const label = this.other.labels.map.at(nearestValue(this.other.preview, toPatient(this.host.volume, place)));
    return label ? labelTitle(label) : '';
  }

  private slabControls(): HTMLElement[] {
    const kinds = [['', 'Slice'], ['maximum', 'Maximum of a slab'], ['mean', 'Mean of a slab']] as const;
    const { slab } = this;
    const take = (): void => {
      this.slab = slabOfText(`${kind.value}-${thick.value}`);
      thickness.hidden = this.slab === null;
      this.askForOwn();
      this.changed();
    };
    const kind = select(kinds, slab?.projection, take);
    const thick = select(thicknesses.map((value) => [String(value), `${value} mm`]), String(slab?.thickness ?? 10), take);
    const thickness = field('Thickness', thick);
    thickness.hidden = slab === null;
    return [field('Show', kind), thickness];
  }

  private obliqueControl(): HTMLElement {
    return checkbox('Oblique plane', this.showsOblique, (isOn) => {
      this.showsOblique = isOn;
      this.askForOwn();
      this.showOwn();
    });
  }

  private async list(): Promise<boolean> {
    const { volumes, next } = await client.listVolumes('', this.scope.signal);
    this.next = next;
    this.offer(volumes);
    return this.choice.length > 1;
  }

  private async listOlder(): Promise<void> {
    if (this.isListing) return;
    this.isListing = true;
    try {
      while (this.next !== null && this.choice.length <= mostListed) {
        const page = await client.listVolumes(this.next, this.scope.signal, perPage);
        this.next = page.next;
        this.offer(page.volumes);
      }
      if (this.next === null) return;
      this.next = null;
      this.choice.append(h('option', { disabled: true }, `Only the newest ${formatCount(this.choice.length - 1)} volumes are listed.`));
    } finally {
      this.isListing = false;
    }
  }

  private offer(volumes: readonly Volume[]): void {
    const others = volumes.filter(({ id }) => id !== this.host.volume.id);
    this.choice.append(...others.map((one) => h('option', { value: one.id }, volumeName(one))));
  }

  // With labels the controls are off, and keep what was chosen.
  private showKind(): void {
    const areLabels = this.host.areLabels();
    if (areLabels === this.wereLabels) return;
    this.wereLabels = areLabels;
    for (const control of this.valueControls) {
      control.title = areLabels ? notForLabels : '';
      for (const one of control.querySelectorAll<HTMLInputElement | HTMLSelectElement>('input, select')) one.disabled = areLabels;
    }
    this.showOwn();
  }

  private askForOwn(): void {
    this.own.retry();
    this.update();
  }

  private showOwn(): void {
    this.host.oblique.show(this.showsOblique && !this.host.areLabels() ? this.own.preview : null);
    this.changed();
  }

  // That one over the slices; '' for none.
  private async show(id: string): Promise<void> {
    this.wanted.abort();
    const wanted = new AbortController();
    this.wanted = wanted;
    this.other = null;
    this.opacity.hidden = id === '';
    this.changed();
    if (id === '') return;
    try {
      const volume = await client.getVolume(id);
      const other = (await this.labelLayer(volume, wanted.signal)) ?? (await this.valueLayer(volume, wanted.signal));
      if (wanted.signal.aborted) return;
      this.other = other;
      this.changed();
    } catch (error) {
      if (!wanted.signal.aborted) throw error;
    }
  }

  private async valueLayer(volume: Volume, signal: AbortSignal): Promise<Layer> {
    const counts = await client.histogramOf(volume.id, bins, signal);
    return { volume, preview: await fetchPreview(volume.id, largestPreview, defaultWindow(counts, volume.suggested_iso), signal), labels: null };
  }

  // Null where a volume has no labels, or where samples of a preview do not tell them.
  private async labelLayer(volume: Volume, signal: AbortSignal): Promise<Layer | null> {
    if (!areLabels(volume) || isRenumbered(volume)) return null;
    const { labels } = await client.labelsOf(volume.id, 0, signal);
    if (labels.length === 0) return null;
    if (labels.length > mostInBytes || volume.dims.some((count) => count > largestPreview)) {
      tell(`The overlay has values instead of labels: it has more than ${mostInBytes} labels, or more than ${largestPreview} samples along an axis.`);
      return null;
    }
    const look = lookOf(labels);
    return { volume, preview: await fetchLabelPreview(volume.id, look.map, signal), labels: look };
  }

  private changed(): void {
    this.changes.value += 1;
  }
}
