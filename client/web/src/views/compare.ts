// Two to four surfaces side by side that turn together: #/compare?jobs=A,B
import { getJob, getVolume } from '../api/client';
import { follow } from '../api/follow';
import { ApiError, asApiError, errorOfProblem } from '../api/problem';
import { isFinal, type Job, type JobParameters } from '../api/types';
import { placeOfText, placeToText, viewNames, viewTitles } from '../scene/views';
import { button, h } from '../ui/dom';
import { formatCount, formatMilliseconds, formatNumber, formatValue } from '../ui/format';
import { refusal } from '../ui/notices';
import { hashOf, noteInAddress, type Route } from '../ui/route';
import type { Scope } from '../ui/signal';
import { volumeName } from '../volume/names';
import { SurfacePane } from './surface_pane';

const most = 4;
const noteDelay = 300;

// The parameters in which the jobs differ, in words for each job.
export function differences(jobs: readonly Job[]): string[] {
  const words: [keyof JobParameters, (parameters: JobParameters) => string][] = [
    ['volume', ({ volume }) => `volume ${volume.slice(0, 8)}`],
    ['iso', ({ iso }) => `iso ${iso === 'otsu' ? 'Otsu' : formatValue(iso)}`],
    ['scheme', ({ scheme }) => `${scheme} tetrahedra`],
    ['interpolation', ({ interpolation }) => interpolation],
    ['passes', ({ passes }) => `${passes} passes`],
    ['smoothing', ({ smoothing }) => smoothing],
    ['lambda', ({ lambda }) => `lambda ${lambda}`],
    ['close', ({ close }) => (close ? 'closed' : 'open')],
  ];
  const varying = words.filter(
    ([name]) => new Set(jobs.map(({ parameters }) => JSON.stringify(parameters[name]))).size > 1,
  );
  return jobs.map(({ parameters }) =>
    varying.length > 0 ? varying.map(([, say]) => say(parameters)).join(', ') : 'the same parameters',
  );
}

function numbersOf(job: Job): HTMLElement {
  const { mesh } = job;
  if (!mesh) return h('p', {}, job.state);
  const { extracted, smoothed } = mesh.volume_mm3;
  const percent = extracted === 0 ? 0 : (100 * (smoothed - extracted)) / Math.abs(extracted);
  const work = (job.timing.total ?? 0) - (job.timing.queue ?? 0);
  const rows: [string, string][] = [
    ['Triangles', formatCount(mesh.triangles)],
    ['Volume', `${formatValue(smoothed)} mm\u00b3`],
    ['by smoothing', `${percent > 0 ? '+' : ''}${formatNumber(percent, 2)} %`],
    // An equal job's files were there already.
    ['Time', work < 1 ? 'was made before' : formatMilliseconds(work)],
  ];
  const angle = mesh.quality?.smallest_angle_deg?.smoothed;
  if (angle) rows.push(['Mean smallest angle', `${formatNumber(angle.mean, 1)}\u00b0`]);
  return h('dl', {}, ...rows.flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)]));
}

async function finished(id: string, scope: Scope, onChange: (job: Job) => void): Promise<Job> {
  const job = await getJob(id);
  return isFinal(job.state) ? job : follow(id, scope.signal, onChange);
}

export async function compareView(scope: Scope, route: Route): Promise<HTMLElement> {
  const ids = (route.query.get('jobs') ?? '').split(',').filter(Boolean).slice(0, most);
  if (ids.length < 2) {
    throw new ApiError(-1, 'Nothing to compare', 'Choose two to four jobs in the list of jobs.');
  }
  const jobs = await Promise.all(ids.map((id) => getJob(id)));
  const titles = differences(jobs);
  const [first] = jobs;
  const volume = first ? await getVolume(first.volume).catch(() => null) : null;
  const isOneVolume = jobs.every((job) => job.volume === volume?.id);
  const camera = placeOfText(route.query.get('cam') ?? '');
  const panes: SurfacePane[] = [];
  let noting = 0;
  scope.onEnd(() => clearTimeout(noting));

  const showPane = async (job: Job, cell: HTMLElement): Promise<void> => {
    const holder = cell.querySelector('.cell-view');
    const facts = cell.querySelector('.cell-numbers');
    if (!holder || !facts) return;
    facts.replaceChildren(numbersOf(job));
    if (job.state !== 'succeeded') {
      const text = job.error ? errorOfProblem(job.error) : new ApiError(-1, 'Cancelled', 'The job made no surface.');
      holder.replaceChildren(refusal(text));
      return;
    }
    const start = panes[0]?.camera ?? camera;
    const pane = new SurfacePane(scope, job, { hasKeys: false, camera: start, volume });
    panes.push(pane);
    pane.onCamera = (place) => {
      for (const other of panes) if (other !== pane) other.follow(place);
      clearTimeout(noting);
      noting = window.setTimeout(() => noteInAddress({ cam: placeToText(place) }), noteDelay);
    };
    holder.replaceChildren(pane.element);
    await pane.load();
  };

  const cells = jobs.map((job, place) => {
    const status = h('p', { class: 'cell-status', role: 'status' }, job.state);
    const cell = h(
      'section',
      { class: 'cell', 'aria-label': titles[place] },
      h(
        'header',
        {},
        h('h2', {}, h('a', { href: hashOf(['jobs', job.id]) }, titles[place] ?? '')),
        h('div', { class: 'cell-numbers' }),
      ),
      h('div', { class: 'cell-view' }, status),
    );
    const onChange = (now: Job): void => {
      status.textContent = `${now.state === 'queued' ? 'queued' : now.stage}, ${Math.round(100 * now.progress)} %`;
    };
    finished(job.id, scope, onChange).then(
      (done) => {
        // The cell has its place in the page by now.
        if (!scope.isOver) void showPane(done, cell);
      },
      (error: unknown) => {
        if (!scope.isOver) cell.querySelector('.cell-view')?.replaceChildren(refusal(asApiError(error)));
      },
    );
    return cell;
  });

  const all = (run: (pane: SurfacePane) => void) => (): void => panes.forEach(run);
  let isFlat = false;
  let isWired = false;
  const flat = button(
    'Flat',
    () => {
      isFlat = !isFlat;
      flat.setAttribute('aria-pressed', String(isFlat));
      all((pane) => pane.setStyle({ shading: isFlat ? 'flat' : 'smooth' }))();
    },
    { 'aria-pressed': 'false' },
  );
  const wires = button(
    'Wires',
    () => {
      isWired = !isWired;
      wires.setAttribute('aria-pressed', String(isWired));
      all((pane) => pane.setStyle({ wireframe: isWired }))();
    },
    { 'aria-pressed': 'false' },
  );
  return h(
    'div',
    { class: 'compare', 'data-count': cells.length },
    h(
      'div',
      { class: 'section-head' },
      h('h1', { title: volume ? volumeName(volume) : '' }, volume && isOneVolume ? `Compare, ${volumeName(volume)}` : 'Compare'),
      h(
        'div',
        { class: 'tool-group', role: 'toolbar', 'aria-label': 'View of all' },
        ...viewNames.map((name) =>
          button(name, () => panes[0]?.look(name), { 'aria-label': viewTitles[name], title: viewTitles[name] }),
        ),
        button('Fit', () => panes[0]?.fit()),
        flat,
        wires,
      ),
      h('span', { class: 'hint' }, 'The cameras are linked.'),
    ),
    h('div', { class: 'grid' }, ...cells),
  );
}
