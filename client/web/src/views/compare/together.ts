// Several surfaces in one scene, each with its colour and opacity: #/together?jobs=A,B
import { client } from '../../client';
import { ApiError } from '../../api/problem';
import type { Job, Vec3, Label } from '../../api/types';
import { titlesOf } from '../../job/differences';
import { labelCount } from '../../job/labels';
import { shownFiles } from '../../job/parameters';
import type { Part } from '../../mesh/glb';
import { loadMesh } from '../../mesh/load';
import { viewableFile } from '../../mesh/shown';
import { surfaceDrawing } from '../../scene/graphics';
import type { Surface } from '../../scene/surface';
import { placeOfText } from '../../scene/views';
import { checkbox, h } from '../../ui/dom';
import { formatCount } from '../../ui/format';
import { tellError } from '../../ui/notices';
import { hashOf, noteInAddress, type Route } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { KnownVolumes } from '../../volume/known';
import { cameraNote, viewButtons } from '../surface/view_tools';
import { looksOfText, looksToText, usual, type SurfaceLook } from './together_look';

const most = 8;

export async function togetherView(scope: Scope, route: Route): Promise<HTMLElement> {
  const ids = (route.query.get('jobs') ?? '').split(',').filter(Boolean).slice(0, most);
  const jobs = (await Promise.all(ids.map((id) => client.getJob(id)))).filter((job) => viewableFile(job) !== null);
  if (jobs.length === 0) {
    const link = { href: hashOf(['jobs']), text: 'Go to the list of jobs' };
    throw new ApiError(-1, 'No surfaces to show', `The page shows ${shownFiles}.`, [], {}, link);
  }
  const volumes = new KnownVolumes();
  await volumes.find(jobs.map(({ volume }) => volume));
  return new Together(scope, jobs, titlesOf(jobs, (volume) => volumes.nameOf(volume)), route.query).element;
}

class Together {
  readonly element: HTMLElement;
  private readonly view = h('div.viewport');
  private readonly status = h('p.hint', { role: 'status' });
  private readonly looks: SurfaceLook[];
  // Of which job and label, and the number and colour of that in the scene.
  private readonly parts: { at: number; label: Label | undefined; id: number; colour: string }[] = [];
  private surface: Surface | null = null;

  constructor(
    private readonly scope: Scope,
    private readonly jobs: readonly Job[],
    titles: readonly string[],
    private readonly query: URLSearchParams,
  ) {
    this.looks = looksOfText(query.get('looks') ?? '', jobs.map(hasLabels));
    this.element = h('div.job.together', { 'data-title': `In one scene: ${titles.join(', ')}` }, [
      h('div.stage-area', h('div.pane', this.view, this.tools())),
      h('aside.panel', { 'aria-label': 'Surfaces' }, [
        h('header.panel-head', h('h1', 'Surfaces in one scene'), this.status),
        h('ul.surfaces', ...jobs.map((job, at) => this.row(job, at, titles[at] ?? ''))),
        h('p.hint', 'Each surface has the position that its volume gives. Surfaces from different examinations may not align.'),
      ]),
    ]);
    // The canvas takes its size from the page, so the view has to be in it first.
    requestAnimationFrame(() => {
      this.begin().catch((error: unknown) => {
        if (!scope.isOver) tellError(error);
      });
    });
  }

  private tools(): HTMLElement {
    return h('div.tools', [
      h('div.toolbar', { role: 'toolbar', 'aria-label': 'View' }, [
        h('div.tool-group', [
          ...viewButtons((name) => this.surface?.look(name), () => this.surface?.fit()),
        ]),
      ]),
    ]);
  }

  private row(job: Job, at: number, title: string): HTMLElement {
    const look = this.looks[at] as SurfaceLook;
    const change = (next: Partial<SurfaceLook>): void => {
      Object.assign(look, next);
      this.show(at);
      noteInAddress({ looks: looksToText(this.looks) });
    };
    const colour = h('input', { type: 'color', value: look.colour || usual(at), 'aria-label': `Colour of ${title}` });
    colour.addEventListener('input', () => change({ colour: colour.value }));
    colour.disabled = look.colour === '';
    const own = checkbox('colours of its labels', look.colour === '', (isOwn) => {
      colour.disabled = isOwn;
      change({ colour: isOwn ? '' : colour.value });
    });
    const opacity = h('input', { type: 'range', min: 0.1, max: 1, step: 0.05, value: look.opacity, 'aria-label': `Opacity of ${title}` });
    opacity.addEventListener('input', () => change({ opacity: opacity.valueAsNumber }));
    return h('li', { 'data-job': job.id }, [
      colour,
      h('div.surface-row', [
        checkbox(title, look.isShown, (isShown) => change({ isShown })),
        hasLabels(job) ? own : null,
        h('label.surface-opacity', h('span', 'Opacity'), opacity),
        h('span.faint', h('a', { href: hashOf(['jobs', job.id]) }, 'open'), ` ${formatCount(job.mesh?.triangles ?? 0)} triangles`),
      ]),
    ]);
  }

  // Each surface is a part of its own, and of a job by labels each label is; they share its look, but for colours.
  private show(at: number): void {
    const { surface, looks } = this;
    const look = looks[at];
    if (!surface || !look) return;
    for (const part of this.parts.filter((each) => each.at === at)) {
      surface.setColour(part.id, look.colour || part.colour);
      surface.setOpacity(part.id, look.opacity);
    }
    surface.setHidden(new Set(this.parts.filter((each) => looks[each.at]?.isShown === false).map(({ id }) => id)));
  }

  // The part of the scene that shows a job's label; a job without labels has one part.
  private partOf(at: number, label: Part | null): Part {
    const found = this.parts.find((each) => each.at === at && each.label === label?.label);
    const { id, colour } = found ?? { at, label: label?.label, id: this.parts.length, colour: label?.colour ?? usual(at) };
    if (!found) {
      this.parts.push({ at, label: label?.label, id, colour });
      this.show(at);
    }
    return { label: id, colour: this.looks[at]?.colour || colour };
  }

  private async begin(): Promise<void> {
    const drawing = await surfaceDrawing();
    if (this.scope.isOver) return;
    const surface = new drawing.Surface(this.view);
    this.surface = surface;
    this.scope.onEnd(() => surface.dispose());
    surface.canvas.setAttribute('aria-label', `${this.jobs.length} surfaces in one scene. Drag to turn them.`);
    surface.setBounds(around(this.jobs));
    const camera = placeOfText(this.query.get('cam') ?? '');
    if (camera) surface.moveTo(camera);
    const noteCamera = cameraNote(this.scope);
    surface.onCamera = () => noteCamera(surface.place);
    const totals = this.jobs.map(({ mesh }) => mesh?.triangles ?? 0);
    const show = (): void => {
      const total = totals.reduce((sum, count) => sum + count, 0);
      this.status.textContent = `${formatCount(surface.trianglesShown)} of ${formatCount(total)} triangles`;
    };
    surface.onShown = show;
    await Promise.all(
      this.jobs.map((job, at) =>
        loadMesh(job, this.scope.signal, {
          // The finest alone: a coarse level of one would stand for all.
          onBlocks: (blocks, label, isCoarse) => {
            if (!isCoarse) surface.addBlocks(blocks, this.partOf(at, label));
          },
          onProgress: ({ totalTriangles }) => {
            totals[at] = totalTriangles;
            show();
          },
        }),
      ),
    );
    if (this.scope.isOver) return;
    await surface.allShown();
    surface.finish();
    this.view.parentElement?.setAttribute('data-loaded', 'true');
  }
}

function hasLabels(job: Job): boolean {
  return labelCount(job) > 1;
}

function around(jobs: readonly Job[]): [Vec3, Vec3] {
  const boxes = jobs.flatMap(({ mesh }) => (mesh && !mesh.empty ? [mesh.bounds] : []));
  const end = (corner: 0 | 1, pick: (...values: number[]) => number): Vec3 =>
    [0, 1, 2].map((axis) => pick(...boxes.map((box) => box[corner][axis as 0]))) as Vec3;
  return boxes.length > 0 ? [end(0, Math.min), end(1, Math.max)] : [[-1, -1, -1], [1, 1, 1]];
}
