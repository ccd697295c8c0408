// All jobs: what waits in which order, what runs, what is done. #/jobs
import { cancelJob, listJobs, listVolumes } from '../api/client';
import { isFinal, priorities, type Job, type Volume } from '../api/types';
import { button, h } from '../ui/dom';
import { formatCount, formatMilliseconds, formatTime, formatValue, shortId } from '../ui/format';
import { tellError } from '../ui/notices';
import { go, hashOf } from '../ui/route';
import type { Scope } from '../ui/signal';
import { nameIn } from '../volume/names';
import { inWords } from '../volume/parameters';

const refreshEvery = 1500;
const mostCompared = 4;

// As the daemon takes them: by priority, then by age.
export function inOrder(jobs: readonly Job[]): Job[] {
  const rank = (job: Job): number => priorities.indexOf(job.priority);
  return [...jobs].sort((a, b) => rank(a) - rank(b) || (a.id < b.id ? -1 : 1));
}

function cell(...children: (Node | string)[]): HTMLElement {
  return h('td', {}, ...children);
}

function progressOf(job: Job): Node | string {
  if (job.state === 'running') {
    return h(
      'span',
      { class: 'inline-progress' },
      h('progress', { max: 1, value: job.progress, 'aria-label': `Progress of ${shortId(job.id)}` }),
      ` ${job.stage}`,
    );
  }
  if (job.mesh) return `${formatCount(job.mesh.triangles)} triangles`;
  if (job.error) return job.error.detail;
  return '';
}

export async function queueView(scope: Scope): Promise<HTMLElement> {
  const chosen = new Set<string>();
  const body = h('div', { class: 'queue-body' });
  const compare = button(
    'Compare',
    () => go(['compare'], new URLSearchParams({ jobs: [...chosen].join(',') })),
    { class: 'primary', disabled: true },
  );
  const more = button('Older jobs', () => void showMore().catch(tellError), { hidden: true });
  let jobs: Job[] = [];
  let next: string | null = null;
  let volumes = new Map<string, Volume>();
  // Those that were asked for already: what is gone is not asked for again.
  const asked = new Set<string>();

  const choose = (id: string, isOn: boolean): void => {
    if (isOn) chosen.add(id);
    else chosen.delete(id);
    compare.disabled = chosen.size < 2 || chosen.size > mostCompared;
    compare.textContent = chosen.size > 0 ? `Compare (${chosen.size})` : 'Compare';
  };

  const row = (job: Job, place: number): HTMLElement => {
    const pick = h('input', {
      type: 'checkbox',
      checked: chosen.has(job.id),
      disabled: job.state !== 'succeeded',
      'aria-label': `Choose ${shortId(job.id)} to compare`,
    });
    pick.addEventListener('change', () => choose(job.id, pick.checked));
    const cancel = button(
      'Cancel',
      () => {
        cancelJob(job.id).then(() => void refresh().catch(tellError), tellError);
      },
      { class: 'quiet', 'aria-label': `Cancel ${shortId(job.id)}` },
    );
    return h(
      'tr',
      { 'data-job': job.id },
      cell(pick),
      cell(
        h('span', { class: `state ${job.state}` }),
        job.state === 'queued' ? `queued, ${place + 1}.` : job.state,
      ),
      cell(h('span', { class: `priority ${job.priority}` }, job.priority)),
      cell(
        h(
          'a',
          { href: hashOf(['jobs', job.id]) },
          `iso ${job.parameters.iso === 'otsu' ? 'Otsu' : formatValue(job.parameters.iso)}`,
        ),
        h('span', { class: 'faint' }, ` ${inWords(job.parameters)}`),
        h('span', { class: 'of-volume' }, nameIn(volumes, job.volume)),
      ),
      cell(progressOf(job)),
      cell(isFinal(job.state) && job.timing.total ? formatMilliseconds(job.timing.total) : ''),
      cell(h('span', { class: 'faint' }, formatTime(job.created))),
      cell(isFinal(job.state) ? '' : cancel),
    );
  };

  const show = (): void => {
    const waiting = inOrder(jobs.filter((job) => job.state === 'queued'));
    const running = jobs.filter((job) => job.state === 'running');
    const done = jobs.filter((job) => isFinal(job.state));
    const rows = [...running, ...waiting, ...done].map((job) => row(job, waiting.indexOf(job)));
    const focused = document.activeElement?.closest('tr')?.dataset.job;
    const focusedLabel = document.activeElement?.getAttribute('aria-label');
    more.hidden = next === null;
    body.replaceChildren(
      rows.length === 0
        ? h('p', { class: 'empty' }, 'No jobs yet. Choose a volume to begin.')
        : h(
            'table',
            { class: 'jobs' },
            h(
              'thead',
              {},
              h(
                'tr',
                {},
                ...['', 'State', 'Priority', 'Surface', 'Result', 'Time', 'Created', ''].map((name) =>
                  h('th', { scope: 'col' }, name),
                ),
              ),
            ),
            h('tbody', {}, ...rows),
          ),
    );
    // The rows are new; who was on one with the keyboard stays there.
    if (focused !== undefined && focusedLabel) {
      body
        .querySelector<HTMLElement>(`tr[data-job="${focused}"] [aria-label="${focusedLabel}"]`)
        ?.focus();
    }
  };

  const findVolumes = async (): Promise<void> => {
    const unknown = jobs.filter((job) => !volumes.has(job.volume) && !asked.has(job.volume));
    if (unknown.length === 0) return;
    volumes = new Map((await listVolumes()).map((volume) => [volume.id, volume]));
    for (const job of unknown) asked.add(job.volume);
  };

  const refresh = async (): Promise<void> => {
    const page = await listJobs();
    const newest = new Set(page.jobs.map((job) => job.id));
    const older = jobs.filter((job) => !newest.has(job.id) && job.id < (page.jobs.at(-1)?.id ?? ''));
    if (older.length === 0) next = page.next;
    jobs = [...page.jobs, ...older];
    await findVolumes();
    show();
  };
  const showMore = async (): Promise<void> => {
    if (next === null) return;
    const page = await listJobs(next);
    jobs = [...jobs, ...page.jobs];
    next = page.next;
    await findVolumes();
    show();
  };

  await refresh();
  const timer = setInterval(() => {
    // A lost connection is said at the top of the page.
    if (!document.hidden) refresh().catch(() => undefined);
  }, refreshEvery);
  scope.onEnd(() => clearInterval(timer));
  return h(
    'div',
    { class: 'queue' },
    h(
      'div',
      { class: 'section-head' },
      h('h1', {}, 'Jobs'),
      h('span', { class: 'hint grow' }, 'Stat goes before routine, routine before bulk; then the oldest.'),
      compare,
    ),
    body,
    h('div', { class: 'actions' }, more),
  );
}
