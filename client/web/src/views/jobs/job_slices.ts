// Three slices beside a surface, through the place that was clicked on it.
import { client } from '../../client';
import type { Job, Label, Vec3, Volume, VolumeLabels } from '../../api/types';
import { middleOf, type LabelState } from '../../job/labels';
import { h } from '../../ui/dom';
import { tellError } from '../../ui/notices';
import { noteInAddress } from '../../ui/route';
import { Scope } from '../../ui/signal';
import { cssColour } from '../../ui/theme';
import { cursorOfText, sampleAt } from '../../volume/geometry';
import { defaultWindow } from '../../volume/histogram';
import { Once } from '../../volume/once';
import { SliceSource } from '../../volume/slices';
import type { SurfacePane } from '../surface/surface_pane';
import { SliceView, type SliceHost } from '../slices/slice_view';

const bins = 1024;

class JobSlices {
  readonly element = h('section.slices', { 'aria-label': 'Slices' });
  // The point where the slices meet, for the cross on the surface and the address.
  onCursor: ((cursor: Vec3) => void) | null = null;
  cursor: Vec3;
  private views: SliceView[] = [];
  private readonly places = new Once<VolumeLabels>();

  constructor(
    private readonly volume: Volume,
    private readonly labels: LabelState,
    place: string,
  ) {
    this.cursor = cursorOfText(place, volume);
  }

  // The surface's own iso-value is drawn as a contour.
  async load(scope: Scope, job: Job): Promise<void> {
    const { volume } = this;
    const iso = job.mesh?.iso ?? null;
    const common = defaultWindow(await client.histogramOf(volume.id, bins, scope.signal), iso ?? volume.suggested_iso);
    let window = common;
    const update = (): void => {
      for (const view of this.views) view.update();
    };
    const host: SliceHost = {
      volume,
      source: new SliceSource(volume, scope),
      commonWindow: common,
      state: () => ({ iso, labels: this.labels.look(), window, cursor: this.cursor }),
      setWindow: (next) => {
        window = next;
        update();
      },
      setCursor: (cursor) => this.goTo(cursor),
      setIso: () => undefined,
      contourColour: () => cssColour('--contour'),
      crop: null,
      measures: null,
      layers: null,
      oblique: null,
      onError: tellError,
    };
    this.views = (['axial', 'coronal', 'sagittal'] as const).map((plane) => new SliceView(plane, host, scope));
    this.element.replaceChildren(...this.views.map(({ element }) => element));
    scope.onEnd(this.labels.hidden.subscribe(update));
    scope.onEnd(this.labels.colours.subscribe(update));
    requestAnimationFrame(update);
  }

  goTo(cursor: Vec3): void {
    this.cursor = cursor;
    for (const view of this.views) view.update();
    this.onCursor?.(cursor);
  }

  async goToLabel(label: Label, background: number): Promise<void> {
    const { labels } = await this.places.get(String(background), () => client.labelsOf(this.volume.id, background));
    const found = labels.find((one) => one.label === label);
    if (found) this.goTo(middleOf(found));
  }

  // In millimetres.
  goToPoint(point: Vec3): void {
    this.goTo(sampleAt(this.volume, point));
  }
}

// They are there or not, as the address says, and go with a surface.
export class SlicesBeside {
  private readonly slices: JobSlices;
  private pane: SurfacePane | null = null;
  // While they are there.
  private shown: Scope | null = null;

  constructor(
    scope: Scope,
    private readonly job: Job,
    volume: Volume,
    labels: LabelState,
    private readonly area: HTMLElement,
    private readonly query: URLSearchParams,
  ) {
    this.slices = new JobSlices(volume, labels, query.get('at') ?? '');
    this.slices.onCursor = (cursor) => {
      this.pane?.setCursor(cursor);
      noteInAddress({ at: cursor.join(',') });
    };
    scope.onEnd(() => this.shown?.end());
    scope.onEnd(labels.chosen.subscribe((label) => {
      if (this.shown && label !== null) this.slices.goToLabel(label, job.parameters.background ?? 0).catch(tellError);
    }));
  }

  linkTo(pane: SurfacePane): void {
    this.pane = pane;
    pane.onPoint = (point) => {
      if (this.shown) this.slices.goToPoint(point);
    };
  }

  // To be called once the surface has its tools.
  restore(): void {
    if (this.query.get('slices') === 'on') this.toggle();
  }

  toggle(): void {
    const { slices } = this;
    const isOn = !this.shown;
    this.shown?.end();
    this.shown = isOn ? new Scope() : null;
    this.pane?.press('slices', isOn);
    this.area.classList.toggle('with-slices', isOn);
    if (this.shown) {
      this.area.append(slices.element);
      slices.load(this.shown, this.job).catch(tellError);
    } else {
      slices.element.remove();
    }
    this.pane?.setCursor(isOn ? slices.cursor : null);
    noteInAddress({ slices: isOn ? 'on' : '', at: isOn ? slices.cursor.join(',') : '' });
  }
}
