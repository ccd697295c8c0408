// One job: its way, then its surface. #/jobs/ID
import { stages } from '../../../generated/parameters';
import { client } from '../../client';
import { asApiError, emptyReason, errorOfProblem } from '../../api/problem';
import { isFinal, type Job, type Volume } from '../../api/types';
import { isRenumbered, LabelState, labelsOfMesh } from '../../job/labels';
import { inWords } from '../../job/parameters';
import { changeLink, eraseJob } from '../../job/variants';
import { surfaceDrawing } from '../../scene/graphics';
import { placeOfText } from '../../scene/views';
import { button, h } from '../../ui/dom';
import { shortId } from '../../ui/format';
import { refusal, tellError } from '../../ui/notices';
import { hashOf, noteInAddress, type Route } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { KnownVolumes } from '../../volume/known';
import { accuracy, againSection, compareSection, downloads, numbers, quality, section, timings, titleOf } from './job_panel';
import { SlicesBeside } from './job_slices';
import { printCheck } from './print_check';
import { openReport } from './report';
import { LabelList } from '../labels/label_list';
import { SurfacePane } from '../surface/surface_pane';
import { cameraNote } from '../surface/view_tools';

// The stages of this job.
function stagesOf({ parameters }: Job): string[] {
  const isSimplified = (parameters.max_error_mm ?? parameters.triangles ?? null) !== null;
  const isLeftOut: Partial<Record<string, boolean>> = { smooth: parameters.passes === 0, untangle: !parameters.untangle, simplify: !isSimplified, certify: !parameters.certify, thickness: (parameters.min_thickness_mm ?? null) === null };
  return stages.filter((name) => !isLeftOut[name]);
}

// The volume that the job was made of. It may be missing while its surface is still there.
interface Source {
  volume: Volume | null;
  name: string;
}

async function sourceOf({ volume: id }: Job): Promise<Source> {
  const volumes = new KnownVolumes();
  await volumes.find([id]);
  return { volume: volumes.get(id), name: volumes.nameOf(id) };
}

function head(job: Job, { volume, name }: Source): HTMLElement {
  return h('header.panel-head', [
    h('h1', titleOf(job)),
    h('p.of-volume', name),
    h('p', inWords(job.parameters)),
    h('p.links', [
      volume && h('a', { href: changeLink(job) }, 'Change parameters'),
      isFinal(job.state) && button('Erase', () => void eraseJob(job).then((isErased) => isErased && location.replace(hashOf(['jobs']))), { class: 'link' }),
      h('span.faint', `job ${shortId(job.id)}`),
    ]),
  ]);
}

class ProgressPanel {
  readonly element: HTMLElement;
  private readonly bar = h('progress', { max: 1, value: 0, 'aria-label': 'Progress of the job' });
  private readonly text = h('p.progress-text', { role: 'status' });
  private readonly steps = new Map<string, HTMLElement>();

  constructor(job: Job) {
    const cancel = button('Cancel', () => {
      cancel.disabled = true;
      client.cancelJob(job.id).catch((error: unknown) => {
        cancel.disabled = false;
        tellError(error);
      });
    });
    for (const name of stagesOf(job)) this.steps.set(name, h('li', name));
    this.element = h('section.panel-section.progress-panel', [
      h('h2', 'Progress'),
      h('ol.stages', ...this.steps.values()),
      this.bar,
      this.text,
      h('div.actions', cancel),
    ]);
  }

  show(job: Job): void {
    const now = stages.indexOf(job.stage);
    stages.forEach((name, place) => {
      const step = this.steps.get(name);
      step?.classList.toggle('done', place < now);
      step?.classList.toggle('now', place === now);
      if (place === now) step?.setAttribute('aria-current', 'step');
      else step?.removeAttribute('aria-current');
    });
    this.bar.value = job.progress;
    this.text.textContent =
      job.state === 'queued'
        ? job.waiting_for
          ? `Waiting for free space on the server's ${job.waiting_for}`
          : `Waiting in the queue with priority ${job.priority}`
        : `${job.stage}, ${Math.round(100 * job.progress)} % done`;
  }
}

export async function jobView(scope: Scope, route: Route): Promise<HTMLElement> {
  // While the daemon is asked.
  surfaceDrawing().catch(() => undefined);
  const first = await client.getJob(route.path[1] ?? '');
  const source = await sourceOf(first);
  const { volume } = source;
  const stageArea = h('div.stage-area');
  const panel = h('aside.panel', { 'aria-label': 'Job' });
  const element = h('div.job', { 'data-state': first.state }, stageArea, panel);

  // A tab in the background says how far its job is.
  const name = [titleOf(first), volume && source.name].filter(Boolean).join(', ');
  const nameTab = (job: Job): void => {
    const far = job.state === 'succeeded' ? '' : job.state === 'running' ? `${Math.round(100 * job.progress)} %: ` : `${job.state}: `;
    element.dataset.title = far + name;
  };
  nameTab(first);

  const showEnd = async (job: Job): Promise<void> => {
    element.dataset.state = job.state;
    nameTab(job);
    if (job.state !== 'succeeded' || !job.mesh) return showFailure(job, source, stageArea, panel);
    const labels = await labelsOfMesh(job);
    if (!scope.isOver) showSurface(scope, route, job, new LabelState(labels, volume !== null && isRenumbered(volume)), source, stageArea, panel);
  };
  if (isFinal(first.state)) {
    await showEnd(first);
    return element;
  }

  const progress = new ProgressPanel(first);
  progress.show(first);
  stageArea.append(h('div.waiting', h('p', 'The surface appears here when it is ready.')));
  panel.append(head(first, source), progress.element);
  client.follow(first.id, scope.signal, (job) => {
    element.dataset.state = job.state;
    nameTab(job);
    progress.show(job);
  })
    .then(async (job) => {
      if (!scope.isOver) await showEnd(job);
    })
    .catch((error: unknown) => {
      if (!scope.isOver) panel.replaceChildren(head(first, source), refusal(asApiError(error)));
    });
  return element;
}

function showFailure(job: Job, source: Source, stageArea: HTMLElement, panel: HTMLElement): void {
  const change = h('a.button.primary', { href: changeLink(job) }, 'Change parameters');
  const body = job.error
    ? refusal(errorOfProblem(job.error), change)
    : h('div.refusal', h('h2', 'Cancelled'), h('p', 'The job was cancelled and made no surface.'), h('div.actions', change));
  stageArea.replaceChildren(h('div.waiting', body));
  panel.replaceChildren(head(job, source), timings(job));
}

function showSurface(
  scope: Scope,
  route: Route,
  job: Job,
  labels: LabelState,
  source: Source,
  stageArea: HTMLElement,
  panel: HTMLElement,
): void {
  const { mesh } = job;
  const { volume } = source;
  if (!mesh) return;
  const camera = placeOfText(route.query.get('cam') ?? '');
  const slices = volume && new SlicesBeside(scope, job, volume, labels, stageArea, route.query);
  const onSlices = slices && ((): void => slices.toggle());
  const pane = new SurfacePane(scope, job, { hasKeys: true, camera: () => camera, volume, labels, onSlices, look: route.query });
  pane.onLook = noteInAddress;
  slices?.linkTo(pane);
  pane.onTools = () => slices?.restore();
  pane.onCamera = cameraNote(scope);
  stageArea.replaceChildren(pane.element);
  const times = timings(job);
  const check = printCheck(job, (places) => pane.mark(places));
  panel.replaceChildren(
    head(job, source),
    ...(labels.labels.length > 0 ? [new LabelList(scope, job, labels, volume).element] : []),
    check ? section('Before you print', check) : '',
    section('Numbers', mesh.empty ? h('p.warning', emptyReason(mesh)) : numbers(job, mesh)),
    accuracy(job, () => void pane.showDistances()) ?? '',
    pane.components.element ?? '',
    times,
    ...(mesh.empty ? [] : [downloads(job, volume, () => openReport(job, () => pane.pictures())), quality(job, mesh)]),
    compareSection(job),
    againSection(job),
  );
  pane.load().then((timing) => {
    if (timing && !scope.isOver) times.replaceWith(timings(job, { ...timing }));
  }, tellError);
}
