// A surface with its tools: what a job made, loaded part by part.
import { histogramOf, slicePicture } from '../api/client';
import { asApiError } from '../api/problem';
import type { Axis, Job, Volume } from '../api/types';
import { loadMesh, viewableFile, type LoadTiming } from '../mesh/load';
import { lengthOf } from '../scene/rulers';
import { defaultStyle, type SurfaceStyle } from '../scene/parts';
import { Surface, type Picked } from '../scene/surface';
import { viewNames, viewTitles, type CameraPlace } from '../scene/views';
import type { LabelState } from '../job/labels';
import { emptyReason } from '../job/empty';
import { button, checkbox, h, isTyping } from '../ui/dom';
import { formatCount } from '../ui/format';
import { refusal, tell, tellError } from '../ui/notices';
import { saveBlob } from '../ui/save';
import { Scope } from '../ui/signal';
import { cssColour } from '../ui/theme';
import { axisIndex, patientAxes } from '../volume/geometry';
import { defaultWindow } from '../volume/histogram';
import type { Window } from '../volume/slices';
import { DistanceLook } from './distance_look';
import { changeLink, fileNameOf, makeVariant } from './job_panel';
import { PickedLabel } from './picked_label';
import { PickedPart } from './picked_part';

const bins = 512;
const turnStep = Math.PI / 36;

export interface PaneOptions {
  // Keys of the whole window are this pane's.
  hasKeys: boolean;
  camera: CameraPlace | null;
  // Null where slices cannot be shown: the volume is gone.
  volume: Volume | null;
  // Of a job by labels: which are shown and how.
  labels: LabelState;
}

interface CutState {
  isOn: boolean;
  axis: Axis;
  index: number;
  flipped: boolean;
}

export class SurfacePane {
  readonly element: HTMLElement;
  onCamera: ((place: CameraPlace) => void) | null = null;
  private surface: Surface | null = null;
  private readonly view = h('div', { class: 'viewport' });
  private readonly status = h('div', { class: 'load-status', role: 'status' });
  private readonly bar = h('progress', { max: 1, value: 0, 'aria-label': 'Loading the surface' });
  private readonly cutControls = h('div', { class: 'cut-controls', hidden: true });
  private readonly announcement = h('div', { class: 'sr-only', 'aria-live': 'polite' });
  private readonly pickedLabel: PickedLabel;
  private readonly pickedPart: PickedPart;
  private distance: DistanceLook | null = null;
  private style: SurfaceStyle = defaultStyle;
  private isMeasuring = false;
  private readonly cut: CutState;
  private window: Window | null = null;
  private pictureWanted = '';
  private isFetching = false;
  private readonly toggles = new Map<string, HTMLButtonElement>();
  // Axial first: what most people think of as a slice.
  private readonly cutAxes: [string, Axis][];

  constructor(
    private readonly scope: Scope,
    private readonly job: Job,
    private readonly options: PaneOptions,
  ) {
    const { volume } = options;
    this.pickedLabel = new PickedLabel(scope, options.labels);
    this.pickedPart = new PickedPart(job, makeVariant(job));
    const [sagittal, coronal, axial] = volume ? patientAxes(volume) : (['x', 'y', 'z'] as const);
    this.cutAxes = [
      ['Axial', axial],
      ['Coronal', coronal],
      ['Sagittal', sagittal],
    ];
    this.cut = {
      isOn: false,
      axis: axial,
      index: volume ? Math.floor(volume.dims[axisIndex(axial)] / 2) : 0,
      flipped: false,
    };
    this.element = h('div', { class: 'pane' }, this.view, this.announcement);
    this.view.append(h('div', { class: 'load' }, this.bar, this.status));
  }

  // Shows the mesh; resolves once all of it is there.
  async load(): Promise<LoadTiming | null> {
    const { mesh } = this.job;
    if (!mesh) return null;
    if (!viewableFile(this.job)) {
      this.say('This job made no file that can be shown. Make it again as GLB or Draco.');
      return null;
    }
    if (mesh.triangles === 0) {
      this.say(emptyReason(this.job, this.options.volume), h('a', { href: changeLink(this.job) }, 'Change parameters'));
      return null;
    }
    let surface: Surface;
    try {
      surface = new Surface(this.view);
    } catch {
      this.say('This browser cannot draw in 3D (WebGL 2 is missing or off). Downloads work all the same.');
      return null;
    }
    this.surface = surface;
    this.scope.onEnd(() => surface.dispose());
    this.prepareSurface(surface);
    surface.setBounds(mesh.bounds);
    if (this.options.camera) surface.moveTo(this.options.camera);
    try {
      const timing = await loadMesh(this.job, this.scope.signal, {
        onBlocks: (blocks, part, isCoarse) => {
          if (part) this.options.labels.learnColour(part.label, part.colour);
          surface.addBlocks(blocks, part, isCoarse);
        },
        onProgress: ({ bytes, totalBytes, triangles, totalTriangles }) => {
          this.bar.value = (bytes / totalBytes + triangles / Math.max(1, totalTriangles)) / 2;
          this.status.textContent =
            bytes < totalBytes || triangles > 0
              ? `${formatCount(triangles)} of ${formatCount(totalTriangles)} triangles`
              : 'Decoding';
        },
      });
      if (this.scope.isOver) return null;
      surface.finish();
      // Who asked for distances wants to see them.
      if (this.distance?.loaded()) this.distance.set(this.options.hasKeys);
      this.element.dataset.loaded = 'true';
      this.bar.parentElement?.remove();
      return timing;
    } catch (error) {
      if (this.scope.isOver) return null;
      this.view.append(
        h(
          'div',
          { class: 'overlay' },
          refusal(
            asApiError(error),
            button('Load again', () => window.location.reload(), { class: 'primary' }),
          ),
        ),
      );
      return null;
    }
  }

  follow(place: CameraPlace): void {
    this.surface?.follow(place);
  }

  get camera(): CameraPlace | null {
    return this.surface?.place ?? null;
  }

  setStyle(change: Partial<SurfaceStyle>): void {
    this.style = { ...this.style, ...change };
    this.surface?.setStyle(this.style);
    this.press('wireframe', this.style.wireframe);
    this.press('flat', this.style.shading === 'flat');
  }

  fit(): void {
    this.surface?.fit();
  }

  look(view: (typeof viewNames)[number]): void {
    this.surface?.look(view);
    this.announcement.textContent = viewTitles[view];
  }

  // Frame times while it moved, for measurements.
  get frameTimes(): readonly number[] {
    return this.surface?.budget.moving ?? [];
  }

  private say(text: string, ...more: Node[]): void {
    this.bar.parentElement?.remove();
    this.view.append(h('div', { class: 'overlay message' }, h('p', {}, text), ...more));
  }

  private prepareSurface(surface: Surface): void {
    surface.canvas.setAttribute(
      'aria-label',
      'The surface. Drag or use the arrow keys to turn it, shift and arrow keys to move it, plus and minus to zoom. Two fingers move and zoom it.',
    );
    surface.onCamera = () => this.onCamera?.(surface.place);
    surface.onPick = (picked) => this.picked(picked, surface);
    this.followLabels(surface);
    const distance = new DistanceLook(this.scope, surface, (isOn) => this.setStyle({ distance: isOn }));
    this.distance = distance;
    const tools = [this.toolbar(surface, distance), this.cutControls, this.pickedLabel.element, this.pickedPart.element];
    this.element.append(h('div', { class: 'tools' }, ...tools), distance.legend);
    this.scope.listen(surface.canvas, 'keydown', (event: KeyboardEvent) => this.moveKey(event, surface));
    if (this.options.hasKeys) {
      this.scope.listen(window, 'keydown', (event: KeyboardEvent) => this.toolKey(event, surface));
    }
  }

  private picked(picked: Picked | null, surface: Surface): void {
    if (!this.isMeasuring) {
      this.options.labels.pick(picked?.label ?? null);
      this.pickedPart.show(picked?.point ?? null);
      return;
    }
    if (!picked) {
      tell('There is no surface at that place.');
      return;
    }
    const ruler = surface.rulers.add(picked.point);
    surface.draw();
    this.announcement.textContent = ruler ? `${lengthOf(ruler).toFixed(1)} millimetres` : 'First point set';
  }

  private followLabels(surface: Surface): void {
    const { hidden, colours } = this.options.labels;
    this.scope.onEnd(hidden.watch((labels) => surface.setHidden(labels)));
    this.scope.onEnd(
      colours.watch((all) => {
        for (const [label, colour] of all) surface.setColour(label, colour);
      }),
    );
  }

  private toggle(name: string, text: string, title: string, onClick: () => void): HTMLButtonElement {
    const element = button(text, onClick, { 'aria-pressed': 'false', title, 'data-tool': name });
    this.toggles.set(name, element);
    return element;
  }

  private press(name: string, isDown: boolean): void {
    this.toggles.get(name)?.setAttribute('aria-pressed', String(isDown));
  }

  private toolbar(surface: Surface, distance: DistanceLook): HTMLElement {
    const opacity = h('input', {
      type: 'range',
      min: 0.1,
      max: 1,
      step: 0.05,
      value: 1,
      'aria-label': 'Opacity',
      title: 'Opacity',
    });
    opacity.addEventListener('input', () => this.setStyle({ opacity: opacity.valueAsNumber }));
    return h(
      'div',
      { class: 'toolbar', role: 'toolbar', 'aria-label': 'View' },
      h(
        'div',
        { class: 'tool-group' },
        ...viewNames.map((name) =>
          button(name, () => this.look(name), {
            title: `${viewTitles[name]} (${name.toLowerCase()})`,
            'aria-label': viewTitles[name],
          }),
        ),
        button('Fit', () => surface.fit(), { title: 'Show all of it (f)' }),
      ),
      h(
        'div',
        { class: 'tool-group' },
        this.toggle('flat', 'Flat', 'Flat shading shows every triangle (t)', () => this.toggleFlat()),
        this.toggle('wireframe', 'Wires', 'Edges only (w)', () => this.toggleWires()),
        distance.toggle,
        h('label', { class: 'opacity' }, h('span', {}, 'Opacity'), opacity),
      ),
      h(
        'div',
        { class: 'tool-group' },
        this.options.volume && this.toggle('cut', 'Cut', 'Cut along a slice (c)', () => this.toggleCut()),
        this.toggle('measure', 'Measure', 'Distance between two points (m)', () => this.toggleMeasure()),
        button('Picture', () => void this.savePicture(surface), { title: 'Save what is shown as PNG' }),
      ),
    );
  }

  private toggleFlat(): void {
    this.setStyle({ shading: this.style.shading === 'flat' ? 'smooth' : 'flat' });
  }

  private toggleWires(): void {
    this.setStyle({ wireframe: !this.style.wireframe });
  }

  private toggleMeasure(): void {
    this.isMeasuring = !this.isMeasuring;
    this.press('measure', this.isMeasuring);
    this.view.classList.toggle('measuring', this.isMeasuring);
    if (this.isMeasuring) tell('Click or tap two points, of the surface or of the slice on its cut. Esc takes the last one back.');
  }

  private toggleCut(): void {
    const { volume } = this.options;
    if (!volume || !this.surface) return;
    this.cut.isOn = !this.cut.isOn;
    this.press('cut', this.cut.isOn);
    this.cutControls.hidden = !this.cut.isOn;
    this.surface.setCut(this.cut.isOn);
    if (!this.cut.isOn) {
      this.pictureWanted = '';
      this.surface.cut.show(null);
      delete this.view.dataset.slice;
      return;
    }
    this.showCutControls(volume);
    this.placeCut();
    this.surface.faceCut();
  }

  private showCutControls(volume: Volume): void {
    const slider = h('input', {
      type: 'range',
      min: 0,
      max: volume.dims[axisIndex(this.cut.axis)] - 1,
      step: 1,
      'aria-label': 'Slice of the cut',
    });
    slider.value = String(this.cut.index);
    const count = volume.dims[axisIndex(this.cut.axis)];
    const place = h('span', { class: 'cut-place' }, `${this.cut.index + 1} / ${count}`);
    slider.addEventListener('input', () => {
      this.cut.index = slider.valueAsNumber;
      place.textContent = `${this.cut.index + 1} / ${count}`;
      this.placeCut();
    });
    const choice = h(
      'select',
      { 'aria-label': 'Direction of the cut' },
      ...this.cutAxes.map(([name, axis]) =>
        h('option', { value: axis, selected: axis === this.cut.axis }, name),
      ),
    );
    choice.addEventListener('change', () => {
      this.cut.axis = choice.value as Axis;
      this.cut.index = Math.floor(volume.dims[axisIndex(this.cut.axis)] / 2);
      this.showCutControls(volume);
      this.placeCut();
      this.surface?.faceCut();
    });
    const other = checkbox('Other side', this.cut.flipped, (flipped) => {
      this.cut.flipped = flipped;
      this.placeCut();
    });
    this.cutControls.replaceChildren(choice, slider, place, other);
  }

  private placeCut(): void {
    const { volume } = this.options;
    if (!volume || !this.surface) return;
    this.surface.cut.place(volume, this.cut);
    this.surface.draw();
    this.pictureWanted = `${this.cut.axis}/${this.cut.index}`;
    void this.fetchPicture(volume);
  }

  // One request at a time; the place that is wanted last is the next.
  private async fetchPicture(volume: Volume): Promise<void> {
    if (this.isFetching) return;
    this.isFetching = true;
    try {
      let shown = '';
      while (this.pictureWanted !== '' && this.pictureWanted !== shown && !this.scope.isOver) {
        shown = this.pictureWanted;
        const { axis, index } = this.cut;
        if (this.window === null) {
          const { iso: asked } = this.job.parameters;
          const iso = typeof asked === 'number' ? asked : volume.suggested_iso;
          this.window = defaultWindow(await histogramOf(volume.id, bins, this.scope.signal), iso);
        }
        const blob = await slicePicture(volume.id, axis, index, this.window, this.scope.signal);
        const picture = await createImageBitmap(blob);
        if (this.scope.isOver || !this.cut.isOn) picture.close();
        else {
          this.surface?.cut.show(picture);
          this.view.dataset.slice = shown;
          this.surface?.draw();
        }
      }
    } catch (error) {
      if (!this.scope.isOver) tellError(error);
    } finally {
      this.isFetching = false;
    }
  }

  private async savePicture(surface: Surface): Promise<void> {
    try {
      const blob = await surface.picture(cssColour('--viewport'));
      saveBlob(blob, fileNameOf(this.job, this.options.volume, '.png'));
    } catch (error) {
      tellError(error);
    }
  }

  private moveKey(event: KeyboardEvent, surface: Surface): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const horizontal = event.key === 'ArrowLeft' ? -1 : event.key === 'ArrowRight' ? 1 : 0;
    const vertical = event.key === 'ArrowDown' ? -1 : event.key === 'ArrowUp' ? 1 : 0;
    if (horizontal !== 0 || vertical !== 0) {
      if (event.shiftKey) surface.pan(-0.05 * horizontal, -0.05 * vertical);
      else surface.turn(turnStep * horizontal, turnStep * vertical);
    } else if (event.key === '+' || event.key === '=') surface.zoom(1 / 1.15);
    else if (event.key === '-') surface.zoom(1.15);
    else return;
    event.preventDefault();
  }

  private toolKey(event: KeyboardEvent, surface: Surface): void {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) return;
    const key = event.key.toLowerCase();
    const view = viewNames.find((name) => name.toLowerCase() === key);
    if (view) this.look(view);
    else if (key === 'f') surface.fit();
    else if (key === 't') this.toggleFlat();
    else if (key === 'w') this.toggleWires();
    else if (key === 'c') this.toggleCut();
    else if (key === 'm') this.toggleMeasure();
    else if (key === 'd') this.distance?.set(!this.distance.isOn);
    else if (key === 'h') this.pickedLabel.hide();
    else if (key === 'o') this.pickedLabel.isolate();
    else if (key === 'e') this.options.labels.showAll();
    else if (key === 'escape') {
      surface.rulers.takeBack();
      surface.draw();
    } else if (key === 'delete') {
      surface.rulers.clear();
      surface.draw();
    }
  }
}
