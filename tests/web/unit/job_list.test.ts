import { expect, it } from 'vitest';
import { ApiError } from '@/api/problem';
import type { Job, JobState } from '@/api/types';
import { JobList, type JobSource } from '@/job/job_list';

const perPage = 100;

function jobOf(number: number, state: JobState, priority = 'routine'): Job {
  return { id: String(number).padStart(6, '0'), state, priority } as Job;
}

// The jobs of a server, the oldest first, and the requests for them.
class Server implements JobSource {
  readonly asked: string[] = [];

  constructor(public jobs: Job[]) {}

  set(number: number, state: JobState): void {
    this.jobs = this.jobs.map((job) => (Number(job.id) === number ? { ...job, state } : job));
  }

  add(state: JobState, count = 1): void {
    for (let n = 0; n < count; n += 1) this.jobs = [...this.jobs, jobOf(this.jobs.length, state)];
  }

  listJobs(cursor = '', { state, limit = perPage }: { state?: JobState; limit?: number } = {}): Promise<{ jobs: Job[]; next: string | null }> {
    this.asked.push(state ?? `page ${cursor}`.trim());
    const found = this.jobs.filter((job) => (!state || job.state === state) && (cursor === '' || job.id < cursor)).reverse();
    const jobs = found.slice(0, limit);
    return Promise.resolve({ jobs, next: found.length > limit ? (jobs.at(-1)?.id ?? null) : null });
  }

  getJob(id: string): Promise<Job> {
    this.asked.push('job');
    const job = this.jobs.find((each) => each.id === id);
    return job ? Promise.resolve(job) : Promise.reject(new ApiError(410, 'Gone', ''));
  }
}

const many = (count: number, state: JobState): Job[] => Array.from({ length: count }, (_, at) => jobOf(at, state));
const numbersIn = (list: JobList, state: JobState): number[] => list.jobs.filter((job) => job.state === state).map(({ id }) => Number(id));
const placeOf = (list: JobList, number: number): number | undefined => list.places().get(jobOf(number, 'queued').id);

it('asks once where one page holds all jobs', async () => {
  const server = new Server([jobOf(0, 'succeeded'), jobOf(1, 'running'), jobOf(2, 'queued'), jobOf(3, 'queued', 'stat')]);
  const list = new JobList(server);
  await list.refresh();
  expect(server.asked).toEqual(['page']);
  expect(list.jobs.map(({ id }) => Number(id))).toEqual([3, 2, 1, 0]);
  expect([placeOf(list, 3), placeOf(list, 2), placeOf(list, 1)]).toEqual([1, 2, undefined]);
});

it('has what runs and waits behind more than a page of newer jobs, with the places in the whole queue', async () => {
  const server = new Server([jobOf(0, 'running'), ...many(132, 'queued').slice(1)]);
  const list = new JobList(server);
  await list.refresh();
  expect(server.asked).toEqual(['page', 'queued', 'running']);
  expect(numbersIn(list, 'running')).toEqual([0]);
  expect(numbersIn(list, 'queued')).toHaveLength(131);
  expect([placeOf(list, 1), placeOf(list, 32), placeOf(list, 131)]).toEqual([1, 32, 131]);
});

it('follows old jobs to their end', async () => {
  const server = new Server([jobOf(0, 'running'), jobOf(1, 'queued'), jobOf(2, 'queued'), ...many(250, 'succeeded').slice(3)]);
  const list = new JobList(server);
  await list.refresh();
  server.set(0, 'failed');
  server.set(1, 'running');
  server.jobs = server.jobs.filter(({ id }) => Number(id) !== 2);
  await list.refresh();
  expect([numbersIn(list, 'failed'), numbersIn(list, 'running'), numbersIn(list, 'queued')]).toEqual([[0], [1], []]);
  await list.loadOlder();
  await list.loadOlder();
  expect([list.next, list.jobs.length]).toEqual([null, 249]);
  server.set(1, 'succeeded');
  await list.refresh();
  expect(list.jobs.filter(({ state }) => state !== 'succeeded').map(({ id }) => Number(id))).toEqual([0]);
  server.asked.length = 0;
  await list.refresh();
  expect(server.asked).toEqual(['page', 'page 000150', 'page 000050']);
});

it('asks for a bounded number of jobs at once, and for all in the end', async () => {
  const server = new Server([...many(90, 'queued'), ...many(250, 'succeeded').slice(90)]);
  const list = new JobList(server);
  await list.refresh();
  server.jobs = many(250, 'succeeded');
  for (let left = 5; left > 0; left -= 1) {
    expect(numbersIn(list, 'queued').length).toBeGreaterThan(0);
    server.asked.length = 0;
    await list.refresh();
    expect(server.asked.length).toBeLessThanOrEqual(23);
  }
  expect(numbersIn(list, 'succeeded')).toHaveLength(190);
});

it('tells no places where the queue is too long to be listed', async () => {
  const server = new Server(many(1200, 'queued'));
  const list = new JobList(server);
  await list.refresh();
  expect([list.hasWholeQueue, list.jobs.length, list.places().size]).toEqual([false, 1000, 0]);
  server.jobs = many(1200, 'succeeded').slice(0, 50);
  await list.refresh();
  expect(list.hasWholeQueue).toBe(true);
});

it('has no gap where more jobs came than a page holds', async () => {
  const server = new Server(many(150, 'succeeded'));
  const list = new JobList(server);
  await list.refresh();
  await list.loadOlder();
  server.add('succeeded', 30);
  await list.refresh();
  expect([list.jobs.length, list.next]).toEqual([180, null]);
  server.add('succeeded', 120);
  await list.refresh();
  expect(list.jobs.map(({ id }) => Number(id))).toEqual(Array.from({ length: 200 }, (_, at) => 299 - at));
  // A refresh that is under way does not disturb it.
  await Promise.all([list.refresh(), list.loadOlder()]);
  expect([list.jobs.length, list.next]).toEqual([300, null]);
});

it('keeps on after a request has failed', async () => {
  const server = new Server(many(3, 'succeeded'));
  const list = new JobList({ getJob: (id) => server.getJob(id), listJobs: (...given) => (server.asked.push('') > 1 ? server.listJobs(...given) : Promise.reject(new TypeError('failed'))) });
  await expect(list.refresh()).rejects.toThrow('failed');
  await list.refresh();
  expect(list.jobs).toHaveLength(3);
});
