// A surface with its tools: what a job made, loaded part by part.
import { client } from '../../client';
import { asApiError, emptyReason, errorOfProblem } from '../../api/problem';
import type { Job, MeshSummary, Vec3, Volume } from '../../api/types';
import type { Block } from '../../mesh/blocks';
import type { Part } from '../../mesh/glb';
import { loadMesh, type LoadProgress, type LoadTiming } from '../../mesh/load';
import { viewableFile, whyNotShown } from '../../mesh/shown';
import { surfaceDrawing } from '../../scene/graphics';
import type { Picked } from '../../scene/picked';
import { defaultStyle, lengthOf, type SurfaceStyle } from '../../scene/style';
import type { Surface } from '../../scene/surface';
import { viewNames, viewTitles, type CameraPlace } from '../../scene/views';
import type { LabelState } from '../../job/labels';
import { withShownGlb } from '../../job/parameters';
import { changeLink, fileNameOf, makeVariant, submitVariant } from '../../job/variants';
import { button, h, isTyping } from '../../ui/dom';
import { formatCount, formatSize } from '../../ui/format';
import { refusal, tell, tellError } from '../../ui/notices';
import { saveBlob } from '../../ui/save';
import { Scope } from '../../ui/signal';
import { ComponentList } from './component_list';
import { CutTool } from './cut_tool';
import { DistanceLook } from './distance_look';
import { labelsOfText, rulersOfText, rulersToText, styleOfText, styleToText } from './look_text';
import { PickedLabel } from '../labels/picked_label';
import { viewButtons } from './view_tools';

const turnStep = Math.PI / 36;

export interface PaneOptions {
  // Keys of the whole window are this pane's.
  hasKeys: boolean;
  // When the surface comes to be drawn; null where it is looked at as a whole.
  camera: () => CameraPlace | null;
  // Null where slices cannot be shown: the volume is gone.
  volume: Volume | null;
  // Shows slices beside the surface, or takes them away; null where there are none.
  onSlices: (() => void) | null;
  // The parameters of the address: cut, style, rulers, hide.
  look: URLSearchParams;
  // For a job by labels: which labels are shown, and their colours.
  labels: LabelState;
}

export class SurfacePane {
  readonly element: HTMLElement;
  onCamera: ((place: CameraPlace) => void) | null = null;
  // How it is looked at has changed: for the address.
  onLook: ((values: Record<string, string>) => void) | null = null;
  // Its tools are there.
  onTools: (() => void) | null = null;
  // A place of the surface was clicked.
  onPoint: ((point: Vec3) => void) | null = null;
  private surface: Surface | null = null;
  private readonly view = h('div.viewport');
  private readonly status = h('div.load-status', { role: 'status' });
  private readonly bar = h('progress', { max: 1, value: 0, 'aria-label': 'Loading the surface' });
  private readonly announcement = h('div.sr-only', { 'aria-live': 'polite' });
  private readonly pickedLabel: PickedLabel;
  readonly components: ComponentList;
  private distance: DistanceLook | null = null;
  private style: SurfaceStyle = defaultStyle;
  private readonly opacity = h('input', {
    type: 'range',
    min: 0.1,
    max: 1,
    step: 0.05,
    value: 1,
    'aria-label': 'Opacity',
    title: 'Opacity',
  });
  private wantsDistance = false;
  private isMeasuring = false;
  private isMeasuringDistances = false;
  // All of it is drawn.
  private isWhole = false;
  private cut: CutTool | null = null;
  private readonly toggles = new Map<string, HTMLButtonElement>();

  constructor(
    private readonly scope: Scope,
    private readonly job: Job,
    private readonly options: PaneOptions,
  ) {
    this.pickedLabel = new PickedLabel(scope, options.labels);
    this.components = new ComponentList(scope, job, makeVariant(job));
    this.element = h('div.pane', this.view, this.announcement);
    this.view.append(h('div.load', this.bar, this.status));
  }

  // Shows the mesh; resolves once all of it is there.
  async load(): Promise<LoadTiming | null> {
    const { mesh } = this.job;
    const surface = mesh && (await this.begin(mesh));
    if (!mesh || !surface) return null;
    this.surface = surface;
    this.scope.onEnd(() => surface.dispose());
    // Whoever follows this surface does not follow it to the camera that its bounds give.
    const camera = this.options.camera();
    surface.setBounds(mesh.bounds);
    this.prepareSurface(surface);
    surface.moveTo(camera ?? surface.place);
    this.restore(surface, this.options.look);
    this.onTools?.();
    try {
      const timing = await this.loadBlocks(surface);
      if (this.scope.isOver) return null;
      surface.finish();
      this.isWhole = true;
      this.components.loaded(surface);
      // A user who asked for distances wants to see them.
      if (this.distance?.loaded()) this.distance.set(this.options.hasKeys || this.wantsDistance);
      else if (this.wantsDistance) void this.showDistances();
      this.element.dataset.loaded = 'true';
      this.bar.parentElement?.remove();
      return timing;
    } catch (error) {
      if (this.scope.isOver) return null;
      this.view.append(
        h('div.overlay', [
          refusal(
            asApiError(error),
            button('Reload', () => window.location.reload(), { class: 'primary' }),
          ),
        ]),
      );
      return null;
    }
  }

  // Ends when all of them are drawn, and so does the progress.
  private async loadBlocks(surface: Surface): Promise<LoadTiming> {
    let latest: LoadProgress = { bytes: 0, totalBytes: 1, totalTriangles: 1 };
    const show = (): void => {
      const { bytes, totalBytes, totalTriangles } = latest;
      const shown = surface.trianglesShown;
      const twice = totalTriangles > (this.job.mesh?.triangles ?? 0) ? ' (walls between two labels count twice)' : '';
      this.bar.value = (bytes / totalBytes + shown / Math.max(1, totalTriangles)) / 2;
      this.status.textContent =
        bytes < totalBytes || shown > 0 ? `${formatCount(shown)} of ${formatCount(totalTriangles)} triangles${twice}` : 'Decoding';
    };
    surface.onShown = show;
    const timing = await loadMesh(this.job, this.scope.signal, {
      onBlocks: (blocks, part, isCoarse) => {
        if (part) this.options.labels.learnColour(part.label, part.colour);
        surface.addBlocks(blocks, part, isCoarse);
      },
      onProgress: (progress) => {
        latest = progress;
        show();
      },
    });
    if (!this.scope.isOver) await surface.allShown();
    return timing;
  }

  // Null, and says why, where there is nothing to be shown.
  private async begin(mesh: MeshSummary): Promise<Surface | null> {
    if (mesh.empty || !viewableFile(this.job)) {
      this.say(mesh.empty ? emptyReason(mesh) : whyNotShown(this.job), h('a', { href: changeLink(this.job) }, 'Change parameters'));
      return null;
    }
    const drawing = await surfaceDrawing().catch(() => null);
    if (this.scope.isOver) return null;
    if (!drawing) {
      this.say('The 3D view could not be loaded.', button('Reload', () => window.location.reload()));
      return null;
    }
    // The canvas takes its size from the page, so the view has to be in it first.
    await new Promise(requestAnimationFrame);
    if (this.scope.isOver) return null;
    try {
      return new drawing.Surface(this.view);
    } catch {
      this.say('This browser cannot draw in 3D (WebGL 2 is missing or off). Downloads still work.');
      return null;
    }
  }

  follow(place: CameraPlace): void {
    this.surface?.follow(place);
  }

  setStyle(change: Partial<SurfaceStyle>): void {
    this.style = { ...this.style, ...change };
    this.surface?.setStyle(this.style);
    this.onLook?.({ style: styleToText(this.style) });
    this.press('wireframe', this.style.wireframe);
    this.press('flat', this.style.shading === 'flat');
  }

  // The point where the slices meet, in the volume's samples; null for none.
  setCursor(cursor: Vec3 | null): void {
    if (this.options.volume) this.surface?.setCross(this.options.volume, cursor);
  }

  // Marks those places of the surface.
  mark(places: readonly Vec3[]): void {
    this.surface?.mark(places);
    this.element.dataset.marks = String(places.length);
    this.element.scrollIntoView({ block: 'nearest' });
  }

  fit(): void {
    this.surface?.fit();
  }

  look(view: (typeof viewNames)[number]): void {
    this.surface?.look(view);
    this.announcement.textContent = viewTitles[view];
  }

  private say(text: string, ...more: Node[]): void {
    this.bar.parentElement?.remove();
    this.view.append(h('div.overlay.message', h('p', text), ...more));
  }

  private prepareSurface(surface: Surface): void {
    surface.canvas.setAttribute(
      'aria-label',
      'The surface. Drag or use the arrow keys to turn it, shift and arrow keys to move it, plus and minus to zoom. Two fingers move and zoom it.',
    );
    surface.onCamera = () => this.onCamera?.(surface.place);
    surface.onPick = (picked) => this.picked(picked, surface);
    this.followLabels(surface);
    const distance = new DistanceLook(this.scope, surface, () => this.toggleDistance(), (isOn) => this.setStyle({ distance: isOn }));
    this.distance = distance;
    if (this.options.volume) this.cut = new CutTool(this.scope, this.job, this.options.volume, this.options.labels, surface, this.view);
    const tools = [this.toolbar(surface, distance), this.cut?.element ?? '', this.pickedLabel.element, this.components.picked];
    this.element.append(h('div.tools', ...tools), distance.legend);
    this.scope.listen(surface.canvas, 'keydown', (event: KeyboardEvent) => this.moveKey(event, surface));
    if (this.options.hasKeys) {
      this.scope.listen(window, 'keydown', (event: KeyboardEvent) => this.toolKey(event, surface));
    }
  }

  // As the address says; from now on it follows.
  private restore(surface: Surface, look: URLSearchParams): void {
    const note = (values: Record<string, string>): void => this.onLook?.(values);
    const style = styleOfText(look.get('style') ?? '');
    this.setStyle({ ...style, distance: false });
    this.opacity.value = String(style.opacity);
    if (style.distance) this.wantsDistance = true;
    this.cut?.restore(look.get('cut') ?? '');
    this.press('cut', this.cut?.isOn ?? false);
    if (this.cut) this.cut.onChange = (cut) => note({ cut });
    surface.rulers.restore(rulersOfText(look.get('rulers') ?? ''));
    surface.rulers.onChange = () => note({ rulers: rulersToText(surface.rulers.all) });
    const { hidden } = this.options.labels;
    const gone = labelsOfText(look.get('hide') ?? '');
    if (gone.size > 0) hidden.value = gone;
    this.scope.onEnd(hidden.subscribe((labels) => note({ hide: [...labels].join(',') })));
  }

  private picked(picked: Picked | null, surface: Surface): void {
    if (!this.isMeasuring) {
      this.options.labels.pick(picked?.label ?? null);
      void this.components.pick(picked);
      if (picked) this.onPoint?.(picked.point);
      return;
    }
    if (!picked) {
      tell(this.isWhole ? 'There is no surface at this point.' : 'The surface is still loading. Try again when all of it is drawn.');
      return;
    }
    const ruler = surface.rulers.add(picked.point);
    surface.draw();
    this.announcement.textContent = ruler ? `${formatSize(lengthOf(ruler))} millimetres` : 'First point set';
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

  press(name: string, isDown: boolean): void {
    this.toggles.get(name)?.setAttribute('aria-pressed', String(isDown));
  }

  private toolbar(surface: Surface, distance: DistanceLook): HTMLElement {
    const { opacity } = this;
    opacity.addEventListener('input', () => this.setStyle({ opacity: opacity.valueAsNumber }));
    return h('div.toolbar', { role: 'toolbar', 'aria-label': 'View' }, [
      h('div.tool-group', [
        ...viewButtons((name) => this.look(name), () => surface.fit(), true),
      ]),
      h('div.tool-group', [
        this.toggle('flat', 'Flat', 'Flat shading shows every triangle (t)', () => this.toggleFlat()),
        this.toggle('wireframe', 'Edges', 'Show the edges of the triangles (w)', () => this.toggleWires()),
        distance.toggle,
        h('label.opacity', h('span', 'Opacity'), opacity),
      ]),
      h('div.tool-group', [
        this.options.volume && this.toggle('cut', 'Cut', 'Cut the surface along a slice (c)', () => this.toggleCut()),
        this.options.onSlices && this.toggle('slices', 'Slices', 'Show slices beside the surface (x)', () => this.options.onSlices?.()),
        this.toggle('measure', 'Measure', 'Measure the distance between two points (m)', () => this.toggleMeasure()),
        button('Picture', () => void this.savePicture(surface), { title: 'Save this view as a PNG file, without a background' }),
      ]),
    ]);
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
    if (this.isMeasuring) tell('Click or tap two points on the surface or on the slice of the cut. Esc removes the last point.');
  }

  private toggleDistance(): void {
    if (!this.isWhole) return;
    if (this.distance?.isOn) this.distance.set(false);
    else void this.showDistances();
  }

  // Measures them if the file holds none: a job of the same surface does, whose triangles take the place of these. Camera, cut and
  // measurements stay.
  async showDistances(): Promise<void> {
    const { distance, surface, job, scope } = this;
    if (!distance || !surface || !this.isWhole) return;
    if (!distance.hasValues) {
      if (this.isMeasuringDistances) return;
      this.isMeasuringDistances = true;
      const load = h('div.load', this.status);
      this.status.textContent = 'Measuring the distances';
      this.view.append(load);
      try {
        const measured = await client.follow((await submitVariant(job, { distances: true, ...withShownGlb(job.parameters) })).id, scope.signal);
        if (measured.error) throw errorOfProblem(measured.error);
        const all: { blocks: Block[]; part: Part | null }[] = [];
        await loadMesh(measured, scope.signal, { onBlocks: (blocks, part, isCoarse) => isCoarse || all.push({ blocks, part }), onProgress: () => undefined });
        surface.replace(all);
        this.components.loaded(surface);
        distance.loaded();
      } catch (error) {
        if (!scope.isOver) tellError(error);
      } finally {
        this.isMeasuringDistances = false;
        load.remove();
      }
    }
    if (!scope.isOver) distance.set(true);
  }

  private toggleCut(): void {
    if (!this.cut) return;
    this.cut.set(!this.cut.isOn);
    this.press('cut', this.cut.isOn);
  }

  // As it is looked at, and from three sides.
  async pictures(): Promise<Blob[]> {
    const { surface, distance } = this;
    if (!surface || !this.isWhole) return [];
    const captions = distance?.captions ?? [];
    const { place } = surface;
    const blobs = [await surface.picture(captions)];
    for (const view of ['A', 'L', 'S'] as const) {
      surface.look(view);
      blobs.push(await surface.picture(captions));
    }
    surface.moveTo(place);
    return blobs;
  }

  private async savePicture(surface: Surface): Promise<void> {
    try {
      saveBlob(await surface.picture(this.distance?.captions ?? []), fileNameOf(this.job, this.options.volume, '.png'));
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
    else if (key === 'x') this.options.onSlices?.();
    else if (key === 'm') this.toggleMeasure();
    else if (key === 'd') this.toggleDistance();
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
