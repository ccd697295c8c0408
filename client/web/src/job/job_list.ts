// The jobs of the list of all jobs, kept up to date by few requests: what runs, what waits, and pages of the others.
import { isGone } from '../api/problem';
import { isFinal, type Job, type JobList as Page, type JobState } from '../api/types';
import { priorities } from './table';

// The server takes no larger number.
export const mostOfState = 1000;
// Jobs that no list has told of since, at each refresh.
const mostAsked = 20;
// Finished jobs older than the pages that were loaded.
const mostEnded = 100;

export interface JobSource {
  listJobs(cursor?: string, filter?: { state?: JobState; limit?: number }): Promise<Page>;
  getJob(id: string): Promise<Job>;
}

// As the daemon takes them, if they have one owner: by priority, then by age.
export function inOrder(jobs: readonly Job[]): Job[] {
  const rank = (job: Job): number => priorities.indexOf(job.priority);
  return [...jobs].sort((a, b) => rank(a) - rank(b) || (a.id < b.id ? -1 : 1));
}

function newestFirst(jobs: Iterable<Job>): Job[] {
  return [...jobs].sort((a, b) => (a.id < b.id ? 1 : -1));
}

export class JobList {
  // All that run and wait, whatever their age, and those of the loaded pages; the newest first.
  jobs: readonly Job[] = [];
  // The cursor of the page after those that were loaded; null if there is none.
  next: string | null = null;
  // False if so many wait that only the newest of them are listed.
  hasWholeQueue = true;
  // Without gaps.
  private loaded: readonly Job[] = [];
  private ended: readonly Job[] = [];
  private queued: readonly Job[] = [];
  private hasOlder = false;
  // Grows so that each of many lost jobs is asked for.
  private turn = 0;
  private last: Promise<void> = Promise.resolve();
  private pending = 0;

  constructor(private readonly source: JobSource) {}

  // True while the server is asked.
  get isBusy(): boolean {
    return this.pending > 0;
  }

  // Makes at most 3 + mostAsked requests, and one if there is only one page.
  refresh(): Promise<void> {
    return this.afterOthers(() => this.lookAgain());
  }

  loadOlder(): Promise<void> {
    return this.afterOthers(() => this.loadPage());
  }

  // It was erased.
  forget(id: string): void {
    const others = (jobs: readonly Job[]): Job[] => jobs.filter((job) => job.id !== id);
    [this.jobs, this.loaded, this.ended] = [others(this.jobs), others(this.loaded), others(this.ended)];
  }

  // Places in the queue, from 1. Empty where they are not known.
  places(): Map<string, number> {
    return new Map(this.hasWholeQueue ? inOrder(this.queued).map(({ id }, at) => [id, at + 1]) : []);
  }

  // Each of them builds on the pages that the others have loaded.
  private async afterOthers(work: () => Promise<void>): Promise<void> {
    this.pending += 1;
    const result = this.last.then(work);
    this.last = result.catch(() => undefined);
    try {
      await result;
    } finally {
      this.pending -= 1;
    }
  }

  private async lookAgain(): Promise<void> {
    const page = await this.source.listJobs();
    const active = page.next === null ? page.jobs.filter(({ state }) => !isFinal(state)) : await this.listActive();
    if (page.next === null) this.hasWholeQueue = true;
    this.takeNewest(page);
    await this.bringUpToDate(new Map([...page.jobs, ...active].map((job) => [job.id, job])));
    this.queued = active.filter(({ state }) => state === 'queued');
    this.settle(active);
  }

  private async loadPage(): Promise<void> {
    if (this.next === null) return;
    const page = await this.source.listJobs(this.next);
    this.hasOlder = true;
    this.loaded = [...this.loaded, ...page.jobs];
    this.next = page.next;
    this.settle(this.jobs.filter(({ state }) => !isFinal(state)));
  }

  // One after the other, so that a job that starts meanwhile is in the second list at least.
  private async listActive(): Promise<Job[]> {
    const queued = await this.source.listJobs('', { state: 'queued', limit: mostOfState });
    const running = await this.source.listJobs('', { state: 'running', limit: mostOfState });
    this.hasWholeQueue = queued.next === null;
    return [...new Map([...queued.jobs, ...running.jobs].map((job) => [job.id, job])).values()];
  }

  private takeNewest({ jobs, next }: Page): void {
    const known = new Set(this.loaded.map(({ id }) => id));
    // Those between the newest page and the loaded ones are unknown after a pause: older ones have to be loaded again.
    if (!this.hasOlder || !jobs.some(({ id }) => known.has(id))) {
      this.hasOlder = false;
      this.loaded = jobs;
      this.next = next;
      return;
    }
    const newest = new Set(jobs.map(({ id }) => id));
    this.loaded = [...jobs, ...this.loaded.filter(({ id }) => !newest.has(id))];
  }

  // Takes over what the lists told, and asks for the others that were not final.
  private async bringUpToDate(told: ReadonlyMap<string, Job>): Promise<void> {
    const open = newestFirst(new Map([...this.jobs, ...this.loaded].map((job) => [job.id, job])).values());
    const lost = this.someOf(open.filter(({ id, state }) => !isFinal(state) && !told.has(id)));
    const now = new Map<string, Job | null>(told);
    await Promise.all(lost.map(async ({ id }) => now.set(id, await this.find(id))));
    const loaded = new Set(this.loaded.map(({ id }) => id));
    this.loaded = this.loaded.flatMap((job) => now.get(job.id) ?? (now.has(job.id) ? [] : [job]));
    const ended = lost.flatMap(({ id }) => (loaded.has(id) ? [] : (now.get(id) ?? [])));
    this.ended = [...this.ended, ...ended.filter(({ state }) => isFinal(state))].slice(-mostEnded);
  }

  // Others at each call if there are more than can be asked for at once.
  private someOf(jobs: readonly Job[]): readonly Job[] {
    if (jobs.length <= mostAsked) return jobs;
    const first = this.turn % jobs.length;
    this.turn += mostAsked;
    return [...jobs.slice(first), ...jobs.slice(0, first)].slice(0, mostAsked);
  }

  // Null if it was erased.
  private async find(id: string): Promise<Job | null> {
    try {
      return await this.source.getJob(id);
    } catch (error) {
      if (isGone(error)) return null;
      throw error;
    }
  }

  private settle(active: readonly Job[]): void {
    this.jobs = newestFirst(new Map([...this.ended, ...active, ...this.loaded].map((job) => [job.id, job])).values());
  }
}
