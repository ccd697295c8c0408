// Two to four surfaces side by side that turn together: #/compare?jobs=A,B
import { client } from '../../client';
import { ApiError, asApiError, errorOfProblem } from '../../api/problem';
import { isFinal, type Job, type LabelSummary } from '../../api/types';
import { changeOf } from '../../job/changes';
import { titlesOf } from '../../job/differences';
import { isRenumbered, LabelState, labelsOfMesh } from '../../job/labels';
import type { SurfaceStyle } from '../../scene/style';
import { placeOfText, type CameraPlace } from '../../scene/views';
import { button, definitions, h } from '../../ui/dom';
import { formatCount, formatMilliseconds, formatNumber, formatValue } from '../../ui/format';
import { refusal } from '../../ui/notices';
import { hashOf, noteInAddress, type Route } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { KnownVolumes } from '../../volume/known';
import { noVolumeText } from '../jobs/certificate';
import { distributionChart } from '../jobs/charts';
import { styleOfText, styleToText } from '../surface/look_text';
import { SurfacePane } from '../surface/surface_pane';
import { cameraNote, viewButtons } from '../surface/view_tools';

const most = 4;

function numbersOf(job: Job): HTMLElement {
  const { mesh } = job;
  if (!mesh) return h('p', job.state);
  const { extracted, smoothed } = mesh.volume_mm3;
  const percent = extracted === 0 ? 0 : (100 * (smoothed - extracted)) / Math.abs(extracted);
  const work = job.timing.total - job.timing.queue;
  const change = changeOf(job.parameters, mesh);
  const volume: [string, string][] = [['Volume', `${formatValue(smoothed)} mm\u00b3`]];
  if (change) volume.push([change.title, `${percent > 0 ? '+' : ''}${formatNumber(percent, 2)} %`]);
  const rows: [string, string][] = [
    ['Triangles', formatCount(mesh.triangles)],
    ...(mesh.quality.encloses_volume ? volume : [['Volume', noVolumeText(mesh.quality)] as [string, string]]),
    // An equal job's files were there already.
    ['Time', work < 1 ? 'already made' : formatMilliseconds(work)],
  ];
  return definitions(rows);
}

async function finished(id: string, scope: Scope, onChange: (job: Job) => void): Promise<Job> {
  const job = await client.getJob(id);
  return isFinal(job.state) ? job : client.follow(id, scope.signal, onChange);
}

export async function compareView(scope: Scope, route: Route): Promise<HTMLElement> {
  const ids = (route.query.get('jobs') ?? '').split(',').filter(Boolean).slice(0, most);
  if (ids.length < 2) {
    const link = { href: hashOf(['jobs']), text: 'Go to the list of jobs' };
    throw new ApiError(-1, 'Nothing to compare', 'Choose two to four jobs in the list of jobs.', [], {}, link);
  }
  const jobs = await Promise.all(ids.map((id) => client.getJob(id)));
  const volumes = new KnownVolumes();
  await volumes.find(jobs.map((job) => job.volume));
  return new Comparison(scope, jobs, volumes, placeOfText(route.query.get('cam') ?? ''), route.query.get('style') ?? '').element;
}

// One of the surfaces with its title and numbers.
class Cell {
  readonly element: HTMLElement;
  private readonly status: HTMLElement;
  private readonly view: HTMLElement;
  private readonly numbers = h('div.cell-numbers');
  private readonly angles = h('div.cell-angles');

  constructor(job: Job, title: string) {
    this.status = h('p.cell-status', { role: 'status' }, job.state);
    this.view = h('div.cell-view', this.status);
    this.element = h('section.cell', { 'aria-label': title }, [
      h('header', h('h2', h('a', { href: hashOf(['jobs', job.id]) }, title)), this.numbers),
      this.view,
      this.angles,
    ]);
  }

  showProgress({ state, stage, progress }: Job): void {
    this.status.textContent = `${state === 'queued' ? 'queued' : stage}, ${Math.round(100 * progress)} %`;
  }

  showNumbers(job: Job): void {
    this.numbers.replaceChildren(numbersOf(job));
    if (job.mesh) this.angles.replaceChildren(distributionChart('Smallest angle', job.mesh.quality.smallest_angle_deg, 60, '\u00b0', changeOf(job.parameters, job.mesh)));
  }

  show(content: HTMLElement): void {
    this.view.replaceChildren(content);
  }
}

class Comparison {
  readonly element: HTMLElement;
  private readonly panes: SurfacePane[] = [];
  private readonly noteCamera: (place: CameraPlace) => void;
  // Those of all surfaces, also of those that are still to come.
  private readonly look: URLSearchParams;

  constructor(
    private readonly scope: Scope,
    jobs: readonly Job[],
    private readonly volumes: KnownVolumes,
    // That of all surfaces, also of those that are still to come.
    private camera: CameraPlace | null,
    style: string,
  ) {
    this.look = new URLSearchParams({ style });
    const titles = titlesOf(jobs, (volume) => volumes.nameOf(volume));
    const [only, ...others] = new Set(jobs.map(({ volume }) => volume));
    const title = only !== undefined && others.length === 0 ? `Compare, ${volumes.nameOf(only)}` : 'Compare';
    const cells = jobs.map((job, place) => this.cellFor(job, titles[place] ?? ''));
    this.element = h('div.compare', { 'data-count': cells.length, 'data-title': `Compare ${titles.join(', ')}` }, [
      this.head(title, jobs.map(({ id }) => id)),
      h('div.grid', ...cells),
    ]);
    this.noteCamera = cameraNote(scope);
  }

  private head(title: string, jobs: readonly string[]): HTMLElement {
    const style = styleOfText(this.look.get('style') ?? '');
    return h('div.section-head', [
      h('h1', title),
      h('div.tool-group', { role: 'toolbar', 'aria-label': 'View of all surfaces' }, [
        ...viewButtons((name) => this.panes[0]?.look(name), () => this.panes[0]?.fit()),
        this.styleButton('Flat', style.shading === 'flat', (isOn) => ({ shading: isOn ? 'flat' : 'smooth' })),
        this.styleButton('Edges', style.wireframe, (isOn) => ({ wireframe: isOn })),
      ]),
      h('span.hint.grow', 'All views turn together.'),
      h('a.button', { href: hashOf(['together'], new URLSearchParams({ jobs: jobs.join(',') })) }, 'Show in one scene'),
    ]);
  }

  // Switches a style of all surfaces.
  private styleButton(text: string, isOnAtFirst: boolean, styleFor: (isOn: boolean) => Partial<SurfaceStyle>): HTMLButtonElement {
    let isOn = isOnAtFirst;
    const toggle = button(
      text,
      () => {
        isOn = !isOn;
        toggle.setAttribute('aria-pressed', String(isOn));
        const style = styleToText({ ...styleOfText(this.look.get('style') ?? ''), ...styleFor(isOn) });
        this.look.set('style', style);
        for (const pane of this.panes) pane.setStyle(styleFor(isOn));
        noteInAddress({ style });
      },
      { 'aria-pressed': String(isOn) },
    );
    return toggle;
  }

  private cellFor(job: Job, title: string): HTMLElement {
    const cell = new Cell(job, title);
    finished(job.id, this.scope, (now) => cell.showProgress(now))
      // The cell has its place in the page by now.
      .then((done) => (this.scope.isOver ? undefined : this.showResult(done, cell)))
      .catch((error: unknown) => {
        if (!this.scope.isOver) cell.show(refusal(asApiError(error)));
      });
    return cell.element;
  }

  private async showResult(job: Job, cell: Cell): Promise<void> {
    cell.showNumbers(job);
    if (job.state !== 'succeeded') {
      const reason = job.error ? errorOfProblem(job.error) : new ApiError(-1, 'Cancelled', 'The job made no surface.');
      cell.show(refusal(reason));
      return;
    }
    const labels = await labelsOfMesh(job);
    if (this.scope.isOver) return;
    const pane = this.addPane(job, labels);
    cell.show(pane.element);
    await pane.load();
  }

  // A surface whose camera moves those of the others.
  private addPane(job: Job, labels: readonly LabelSummary[]): SurfacePane {
    const volume = this.volumes.get(job.volume);
    const pane = new SurfacePane(this.scope, job, {
      hasKeys: false,
      onSlices: null,
      look: this.look,
      camera: () => this.camera,
      volume,
      labels: new LabelState(labels, volume !== undefined && volume !== null && isRenumbered(volume)),
    });
    this.panes.push(pane);
    pane.onCamera = (place) => {
      this.camera = place;
      for (const other of this.panes) if (other !== pane) other.follow(place);
      this.noteCamera(place);
    };
    return pane;
  }
}
