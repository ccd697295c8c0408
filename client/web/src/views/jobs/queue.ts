// All jobs: what waits in which order, what runs, what is done. #/jobs
import { client } from '../../client';
import { isFinal, type Job } from '../../api/types';
import { inWords, surfaceInWords } from '../../job/parameters';
import { priorities } from '../../job/table';
import { button, h } from '../../ui/dom';
import { formatCount, formatMilliseconds, formatTime, shortId } from '../../ui/format';
import { tellError } from '../../ui/notices';
import { go, hashOf, noteInAddress, type Route } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { cell, row, table } from '../../ui/table';
import { KnownVolumes } from '../../volume/known';

const refreshEvery = 1500;
const mostCompared = 4;
const mostTogether = 8;
const columns = ['Choose', 'State', 'Priority', 'Surface', 'Result', 'Time', 'Created', 'Action'];
const unseen = ['Choose', 'Action'];

// As the daemon takes them: by priority, then by age.
export function inOrder(jobs: readonly Job[]): Job[] {
  const rank = (job: Job): number => priorities.indexOf(job.priority);
  return [...jobs].sort((a, b) => rank(a) - rank(b) || (a.id < b.id ? -1 : 1));
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
  if (job.waiting_for) return `waits for free space on the ${job.waiting_for}`;
  return '';
}

function stateCell(job: Job, place: number): HTMLElement {
  const text = job.state === 'queued' ? `queued, number ${place + 1}` : job.state;
  return cell(h('span', { class: `state ${job.state}` }), text);
}

function surfaceCell(job: Job, volume: string): HTMLElement {
  return cell(
    h('a', { href: hashOf(['jobs', job.id]) }, surfaceInWords(job.parameters)),
    h('span', { class: 'faint' }, ` ${inWords(job.parameters)}`),
    h('span', { class: 'of-volume' }, volume),
  );
}

export async function queueView(scope: Scope, { query }: Route): Promise<HTMLElement> {
  const queue = new Queue();
  await queue.refresh();
  queue.restore((query.get('chosen') ?? '').split(','));
  const timer = setInterval(() => {
    // A lost connection is said at the top of the page.
    if (!document.hidden) queue.refresh().catch(() => undefined);
  }, refreshEvery);
  scope.onEnd(() => clearInterval(timer));
  return queue.element;
}

class Queue {
  readonly element: HTMLElement;
  private readonly body = h('div', { class: 'queue-body', tabindex: '0', role: 'region', 'aria-label': 'Jobs' });
  private readonly compare: HTMLButtonElement;
  private readonly together: HTMLButtonElement;
  private readonly more: HTMLButtonElement;
  private readonly chosen = new Set<string>();
  private jobs: Job[] = [];
  private next: string | null = null;
  private readonly volumes = new KnownVolumes();

  constructor() {
    this.compare = button('Compare', () => this.goCompare(), { class: 'primary', disabled: true });
    this.together = button('Show in one scene', () => go(['together'], new URLSearchParams({ jobs: [...this.chosen].join(',') })), {
      disabled: true,
      title: 'Shows two to eight surfaces, each in its own colour',
    });
    this.more = button('Older jobs', () => void this.showMore().catch(tellError), { hidden: true });
    this.element = h(
      'div',
      { class: 'queue' },
      h(
        'div',
        { class: 'section-head' },
        h('h1', {}, 'Jobs'),
        h('span', { class: 'hint grow' }, 'Stat jobs run first, then routine, then bulk. Within a priority, owners take turns.'),
        this.together,
        this.compare,
      ),
      this.body,
      h('div', { class: 'actions' }, this.more),
    );
  }

  // Takes the newest jobs over; older ones that were asked for stay as they are.
  async refresh(): Promise<void> {
    const page = await client.listJobs();
    const newest = new Set(page.jobs.map((job) => job.id));
    const older = this.jobs.filter((job) => !newest.has(job.id) && job.id < (page.jobs.at(-1)?.id ?? ''));
    if (older.length === 0) this.next = page.next;
    this.jobs = [...page.jobs, ...older];
    await this.volumes.find(this.jobs.map(({ volume }) => volume));
    this.show();
  }

  private async showMore(): Promise<void> {
    if (this.next === null) return;
    const page = await client.listJobs(this.next);
    this.jobs = [...this.jobs, ...page.jobs];
    this.next = page.next;
    await this.volumes.find(this.jobs.map(({ volume }) => volume));
    this.show();
  }

  private show(): void {
    const waiting = inOrder(this.jobs.filter((job) => job.state === 'queued'));
    const running = this.jobs.filter((job) => job.state === 'running');
    const done = this.jobs.filter((job) => isFinal(job.state));
    const rows = [...running, ...waiting, ...done].map((job) => this.row(job, waiting.indexOf(job)));
    this.more.hidden = this.next === null;
    this.keepFocus(() =>
      this.body.replaceChildren(
        rows.length === 0 ? h('p', { class: 'empty' }, 'No jobs yet. Choose a volume to begin.') : table(columns, unseen, rows),
      ),
    );
  }

  // The rows are made anew; whoever is on one of them with the keyboard stays there.
  private keepFocus(replace: () => void): void {
    const { activeElement } = document;
    const job = activeElement?.closest('tr')?.dataset.job;
    const label = activeElement?.getAttribute('aria-label');
    replace();
    if (job === undefined || !label) return;
    this.body.querySelector<HTMLElement>(`tr[data-job="${job}"] [aria-label="${label}"]`)?.focus();
  }

  private row(job: Job, place: number): HTMLElement {
    const time = isFinal(job.state) && job.timing.total ? formatMilliseconds(job.timing.total) : '';
    return row(
      { 'data-job': job.id },
      cell(this.pickBox(job)),
      stateCell(job, place),
      cell(h('span', { class: `priority ${job.priority}` }, job.priority)),
      surfaceCell(job, this.volumes.nameOf(job.volume)),
      cell(progressOf(job)),
      cell(time),
      cell(h('span', { class: 'faint' }, formatTime(job.created))),
      cell(isFinal(job.state) ? '' : this.cancelButton(job)),
    );
  }

  private pickBox(job: Job): HTMLElement {
    const box = h('input', {
      type: 'checkbox',
      checked: this.chosen.has(job.id),
      disabled: job.state !== 'succeeded',
      'aria-label': `Choose ${shortId(job.id)} to compare`,
    });
    box.addEventListener('change', () => this.choose(job.id, box.checked));
    return box;
  }

  private cancelButton(job: Job): HTMLElement {
    const cancel = (): void => {
      client.cancelJob(job.id).then(() => void this.refresh().catch(tellError), tellError);
    };
    return button('Cancel', cancel, { class: 'quiet', 'aria-label': `Cancel ${shortId(job.id)}` });
  }

  private choose(id: string, isOn: boolean): void {
    if (isOn) this.chosen.add(id);
    else this.chosen.delete(id);
    // So that the way back from a comparison leads to what was chosen.
    noteInAddress({ chosen: [...this.chosen].join(',') });
    this.showChosen();
  }

  // The jobs of the address that are listed and can be shown.
  restore(ids: readonly string[]): void {
    const listed = this.jobs.filter(({ id, state }) => ids.includes(id) && state === 'succeeded');
    if (listed.length === 0) return;
    for (const { id } of listed) this.chosen.add(id);
    this.show();
    this.showChosen();
  }

  private showChosen(): void {
    const { size } = this.chosen;
    this.together.disabled = size < 2 || size > mostTogether;
    this.compare.disabled = size < 2 || size > mostCompared;
    this.compare.textContent = size > 0 ? `Compare (${size})` : 'Compare';
  }

  private goCompare(): void {
    go(['compare'], new URLSearchParams({ jobs: [...this.chosen].join(',') }));
  }
}
