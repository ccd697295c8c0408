// All jobs: what waits in which order, what runs, what is done. #/jobs
import { client, token } from '../../client';
import { isFinal, type Job } from '../../api/types';
import { inOrder, JobList, mostOfState } from '../../job/job_list';
import { inWords, surfaceInWords } from '../../job/parameters';
import { eraseJob, eraseJobs } from '../../job/variants';
import { button, h } from '../../ui/dom';
import { formatCount, formatMilliseconds, formatTime, shortId } from '../../ui/format';
import { tellError } from '../../ui/notices';
import { go, hashOf, noteInAddress, type Route } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { cell, keepFocus, row, table } from '../../ui/table';
import { KnownVolumes } from '../../volume/known';
import { JobFilter } from './job_filter';

const refreshEvery = 1500;
// Names that are asked for at each refresh.
const mostNames = 100;
const mostCompared = 4;
const mostTogether = 8;
const columns = ['Choose', 'State', 'Priority', 'Surface', 'Result', 'Time', 'Created', 'Action'];
const unseen = ['Choose', 'Action'];

function progressOf(job: Job): Node | string {
  if (job.state === 'running') {
    return h('span.inline-progress', [
      h('progress', { max: 1, value: job.progress, 'aria-label': `Progress of ${shortId(job.id)}` }),
      ` ${job.stage}`,
    ]);
  }
  if (job.mesh) return `${formatCount(job.mesh.triangles)} triangles`;
  if (job.error) return job.error.detail;
  if (job.waiting_for) return `waits for free space on the ${job.waiting_for}`;
  return '';
}

function stateCell(job: Job, place: number | undefined): HTMLElement {
  const text = job.state === 'queued' && place !== undefined ? `queued, number ${place}` : job.state;
  return cell(h('span', { class: `state ${job.state}` }), text);
}

function surfaceCell(job: Job, volume: string): HTMLElement {
  return cell(
    h('a', { href: hashOf(['jobs', job.id]) }, surfaceInWords(job.parameters)),
    h('span.faint', ` ${inWords(job.parameters)}`),
    h('span.of-volume', volume),
  );
}

export async function queueView(scope: Scope, { query }: Route): Promise<HTMLElement> {
  const queue = new Queue(query);
  await queue.refresh();
  queue.restore((query.get('chosen') ?? '').split(','));
  scope.repeat(refreshEvery, () => queue.refresh());
  return queue.element;
}

interface Row {
  // All that it shows.
  text: string;
  element: HTMLElement;
}

class Queue {
  readonly element: HTMLElement;
  private readonly body = h('div.queue-body', { tabindex: '0', role: 'region', 'aria-label': 'Jobs' });
  private readonly compare: HTMLButtonElement;
  private readonly together: HTMLButtonElement;
  private readonly more: HTMLButtonElement;
  private readonly chosen = new Set<string>();
  private readonly note = h('p.hint', { hidden: true }, [
    `More than ${mostOfState} jobs wait. The list has the newest ${mostOfState} of them, without their places.`,
  ]);
  private readonly table = table(columns, unseen, []);
  private readonly empty = h('p.empty');
  private readonly filter: JobFilter;
  private list: JobList;
  private readonly erase = button('Erase', () => void this.eraseChosen(), { class: 'danger', disabled: true });
  private readonly all = button('Choose all', () => this.chooseAll(), { class: 'quiet', title: 'Those of the list that have ended; once more for none' });
  private rows = new Map<string, Row>();
  private readonly volumes = new KnownVolumes();

  constructor(query: URLSearchParams) {
    this.filter = new JobFilter(query, () => {
      this.list = new JobList(this.filter);
      this.refresh().catch(tellError);
    }, () => this.show());
    this.list = new JobList(this.filter);
    this.compare = button('Compare', () => this.goCompare(), { class: 'primary', disabled: true });
    this.together = button('Show in one scene', () => go(['together'], new URLSearchParams({ jobs: [...this.chosen].join(',') })), {
      disabled: true,
      title: 'Shows two to eight surfaces, each in its own colour',
    });
    this.more = button('Older jobs', () => void this.showMore().catch(tellError), { hidden: true });
    this.element = h('div.queue', [
      h('div.section-head', [
        h('h1', 'Jobs'),
        h('span.hint.grow', 'Stat jobs run first, then routine, then bulk. Within a priority, owners take turns.'),
        this.all,
        this.together,
        this.compare,
        this.erase,
      ]),
      this.filter.element,
      this.note,
      this.body,
      h('div.actions', this.more),
    ]);
  }

  async refresh(): Promise<void> {
    await this.list.refresh();
    await this.showNamed();
  }

  private async showMore(): Promise<void> {
    await this.list.loadOlder();
    await this.showNamed();
  }

  private async showNamed(): Promise<void> {
    await this.volumes.find(this.list.jobs.map(({ volume }) => volume), mostNames);
    this.show();
  }

  private ordered(): Job[] {
    const { jobs } = this.list;
    const running = jobs.filter(({ state }) => state === 'running');
    const waiting = inOrder(jobs.filter(({ state }) => state === 'queued'));
    const all = [...running, ...waiting, ...jobs.filter(({ state }) => isFinal(state))];
    return this.filter.shown(all, ({ volume }) => this.volumes.nameOf(volume));
  }

  private show(): void {
    // Jobs of others, whose owners take turns with the token's, may not be listed.
    const places = token.value === '' ? this.list.places() : new Map<string, number>();
    const rows = this.ordered().map((job) => this.row(job, places.get(job.id)));
    this.more.hidden = this.list.next === null;
    this.note.hidden = this.list.hasWholeQueue;
    this.rows = new Map(rows.map((row) => [row.element.dataset.job ?? '', row]));
    this.empty.textContent = this.list.jobs.length === 0 && !this.filter.isOn ? 'No jobs yet. Choose a volume to begin.' : 'No job is like that.';
    const shown: Element = rows.length === 0 ? this.empty : this.table;
    if (this.body.firstElementChild !== shown) this.body.replaceChildren(shown);
    keepFocus(this.body, 'job', () => this.arrange(rows.map(({ element }) => element)));
    this.showChosen();
  }

  // Leaves rows alone that stay: laying out a thousand of them takes long.
  private arrange(rows: readonly HTMLElement[]): void {
    const tbody = this.table.tBodies[0];
    if (!tbody) return;
    const wanted = new Set<Element>(rows);
    for (const old of [...tbody.children]) if (!wanted.has(old)) old.remove();
    rows.forEach((row, at) => {
      const there = tbody.children[at] ?? null;
      if (there !== row) tbody.insertBefore(row, there);
    });
  }

  // The one of before if it would look the same.
  private row(job: Job, place: number | undefined): Row {
    const volume = this.volumes.nameOf(job.volume);
    const text = JSON.stringify([job, place, volume, this.chosen.has(job.id)]);
    const known = this.rows.get(job.id);
    return known?.text === text ? known : { text, element: this.makeRow(job, place, volume) };
  }

  private makeRow(job: Job, place: number | undefined, volume: string): HTMLElement {
    const time = isFinal(job.state) && job.timing.total ? formatMilliseconds(job.timing.total) : '';
    return row(
      { 'data-job': job.id },
      cell(this.pickBox(job)),
      stateCell(job, place),
      cell(h('span', { class: `priority ${job.priority}` }, job.priority)),
      surfaceCell(job, volume),
      cell(progressOf(job)),
      cell(time),
      cell(h('span.faint', formatTime(job.created))),
      cell(isFinal(job.state) ? this.eraseButton(job) : this.cancelButton(job)),
    );
  }

  private pickBox(job: Job): HTMLElement {
    const box = h('input', {
      type: 'checkbox',
      checked: this.chosen.has(job.id),
      disabled: !isFinal(job.state),
      'aria-label': `Choose ${shortId(job.id)}`,
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

  private eraseButton(job: Job): HTMLElement {
    const erase = async (): Promise<void> => {
      if (!(await eraseJob(job))) return;
      if (this.chosen.has(job.id)) this.choose(job.id, false);
      this.list.forget(job.id);
      this.show();
    };
    return button('Erase', () => void erase(), { class: 'quiet', 'aria-label': `Erase ${shortId(job.id)}` });
  }

  private async eraseChosen(): Promise<void> {
    await eraseJobs(this.erasable, (id) => {
      this.list.forget(id);
      this.choose(id, false);
    });
    this.show();
  }

  // Nobody erases what a search hides.
  private get erasable(): string[] {
    return [...this.chosen].filter((id) => this.rows.has(id));
  }

  private chooseAll(): void {
    const ids = this.list.jobs.filter(({ id, state }) => isFinal(state) && this.rows.has(id)).map(({ id }) => id);
    const isOn = ids.some((id) => !this.chosen.has(id));
    for (const id of ids) this.choose(id, isOn);
    this.show();
  }

  private choose(id: string, isOn: boolean): void {
    if (isOn) this.chosen.add(id);
    else this.chosen.delete(id);
    // So that the way back from a comparison leads to what was chosen.
    if (this.chosen.size <= mostTogether) noteInAddress({ chosen: [...this.chosen].join(',') });
    this.showChosen();
  }

  // The jobs of the address that are listed and can be shown.
  restore(ids: readonly string[]): void {
    const listed = this.list.jobs.filter(({ id, state }) => ids.includes(id) && isFinal(state));
    if (listed.length === 0) return;
    for (const { id } of listed) this.chosen.add(id);
    this.show();
  }

  private showChosen(): void {
    const { size } = this.chosen;
    const areMade = this.list.jobs.every(({ id, state }) => state === 'succeeded' || !this.chosen.has(id));
    this.together.disabled = !areMade || size < 2 || size > mostTogether;
    this.compare.disabled = !areMade || size < 2 || size > mostCompared;
    const { length } = this.erasable;
    this.erase.disabled = length === 0;
    this.erase.textContent = length > 0 ? `Erase (${length})` : 'Erase';
    this.compare.textContent = size > 0 ? `Compare (${size})` : 'Compare';
  }

  private goCompare(): void {
    go(['compare'], new URLSearchParams({ jobs: [...this.chosen].join(',') }));
  }
}
