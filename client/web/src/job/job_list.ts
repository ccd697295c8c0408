// The jobs of the list of all jobs, kept up to date by few requests: what runs, what waits, and pages of the others.
import { isGone } from '../api/problem';
import { isFinal, type Job, type JobList as Page, type JobState } from '../api/types';
import { priorities } from './table';

// The server takes no larger number.
export const mostOfState = 1000;
// Jobs that no list has told of since, at each refresh.
const mostAsked = 20;
// Finished jobs older than the pages.
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
  // All that run and wait, whatever their age, and those of the pages that are shown; the newest first.
  jobs: readonly Job[] = [];
  // The cursor of the page after those that are shown; null if there is none.
  next: string | null = null;
  // False if so many wait that only the newest of them are listed.
  hasWholeQueue = true;
  private pages = 1; // that are shown
  // Older than the pages, and followed to their end.
  private ended: readonly Job[] = [];

  constructor(private readonly source: JobSource) {}

  // Makes one request for each page, if that is not the last one two more, and at most mostAsked others.
  async refresh(): Promise<void> {
    const { pages } = this;
    const { jobs: listed, next } = await this.load(pages);
    const active = next === null ? listed.filter(({ state }) => !isFinal(state)) : await this.listActive();
    const told = new Set([...listed, ...active].map(({ id }) => id));
    const untold = this.jobs.filter(({ id, state }) => !isFinal(state) && !told.has(id));
    const ended = await Promise.all(untold.slice(0, mostAsked).map(({ id }) => this.find(id)));
    // An older page was asked for meanwhile.
    if (pages !== this.pages) return;
    if (next === null) this.hasWholeQueue = true;
    this.ended = [...this.ended, ...ended.flatMap((job) => job ?? [])].slice(-mostEnded);
    this.next = next;
    const all = [...this.ended, ...untold.slice(mostAsked), ...active, ...listed];
    this.jobs = newestFirst(new Map(all.map((job) => [job.id, job])).values());
  }

  async loadOlder(): Promise<void> {
    this.pages += 1;
    await this.refresh();
  }

  // It was erased.
  forget(id: string): void {
    const others = (jobs: readonly Job[]): Job[] => jobs.filter((job) => job.id !== id);
    [this.jobs, this.ended] = [others(this.jobs), others(this.ended)];
  }

  // Places in the queue, from 1. Empty where they are not known.
  places(): Map<string, number> {
    const queued = this.hasWholeQueue ? this.jobs.filter(({ state }) => state === 'queued') : [];
    return new Map(inOrder(queued).map(({ id }, at) => [id, at + 1]));
  }

  private async load(pages: number): Promise<Page> {
    const jobs: Job[] = [];
    let next: string | null = '';
    for (let page = 0; page < pages && next !== null; page += 1) {
      const part: Page = await this.source.listJobs(next);
      jobs.push(...part.jobs);
      next = part.next;
    }
    return { jobs, next };
  }

  // One after the other, so that a job that starts meanwhile is in the second list at least.
  private async listActive(): Promise<Job[]> {
    const queued = await this.source.listJobs('', { state: 'queued', limit: mostOfState });
    const running = await this.source.listJobs('', { state: 'running', limit: mostOfState });
    this.hasWholeQueue = queued.next === null;
    return [...new Map([...queued.jobs, ...running.jobs].map((job) => [job.id, job])).values()];
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
}
