// The jobs that are listed, and their order: the server sorts some out, and the list is searched.
import { client } from '../../client';
import type { Job, JobState } from '../../api/types';
import type { JobSource } from '../../job/job_list';
import { inWords, surfaceInWords } from '../../job/parameters';
import { field, h, select } from '../../ui/dom';
import { shortId } from '../../ui/format';
import { noteInAddress } from '../../ui/route';

const states = ['queued', 'running', 'succeeded', 'failed', 'cancelled'] as const satisfies readonly JobState[];
const orders = { '': 'Queue, then newest', oldest: 'Oldest', longest: 'Longest time', largest: 'Most triangles' } as const;
type Order = keyof typeof orders;
const names = ['state', 'since', 'until', 'volume', 'search', 'sort'] as const;

const by: Record<Exclude<Order, ''>, (a: Job, b: Job) => number> = {
  oldest: (a, b) => (a.id < b.id ? -1 : 1),
  longest: (a, b) => (b.timing.total ?? 0) - (a.timing.total ?? 0),
  largest: (a, b) => (b.mesh?.triangles ?? 0) - (a.mesh?.triangles ?? 0),
};

// The server can be asked for these and what is between.
const [firstInstant, lastInstant] = ['0000-01-01T00:00:00Z', '9999-12-31T23:59:59Z'] as const;

// When that day begins on the person's clock, which the list's times are of. Undefined for no day.
export function beginOf(day: string | undefined, daysLater = 0): string | undefined {
  const [, year, month, date] = /^(\d{4,6})-(\d\d)-(\d\d)$/.exec(day ?? '') ?? [];
  if (year === undefined) return undefined;
  const begin = new Date(2000, 0);
  // The constructor of Date would take years below 100 for those of the last century.
  begin.setFullYear(Number(year), Number(month) - 1, Number(date) + daysLater);
  if (Number.isNaN(begin.getTime())) return undefined;
  const instant = begin.toISOString().replace('.000Z', 'Z');
  // Years that four digits cannot write have a sign.
  if (instant.startsWith('+')) return lastInstant;
  return instant.startsWith('-') ? firstInstant : instant;
}

export class JobFilter implements JobSource {
  readonly element: HTMLElement;
  readonly getJob = (id: string): Promise<Job> => client.getJob(id);
  private readonly values: Partial<Record<(typeof names)[number], string>> = {};

  // `onFilter`: the server lists others. `onOrder`: the same are shown otherwise.
  constructor(query: URLSearchParams, onFilter: () => void, onOrder: () => void) {
    for (const name of names) this.values[name] = query.get(name) ?? '';
    const { values } = this;
    const set = (name: (typeof names)[number], value: string, changed: () => void): void => {
      values[name] = value;
      noteInAddress({ [name]: value });
      changed();
    };
    const date = (name: 'since' | 'until', label: string): HTMLElement =>
      field(label, h('input', { type: 'date', value: values[name], onChange: ({ target }: Event) => set(name, (target as HTMLInputElement).value, onFilter) }));
    const search = h('input', { type: 'search', value: values.search, placeholder: 'Volume, surface or job' });
    search.addEventListener('input', () => set('search', search.value, onOrder));
    const all = h('a.button', { href: '#/jobs', hidden: !values.volume }, 'Jobs of all volumes');
    this.element = h('form.job-filter', { onSubmit: (event: Event) => event.preventDefault() }, [
      field('Search', search),
      field('State', select([['', 'All'], ...states.map((name) => [name, name] as const)], values.state, (state) => set('state', state, onFilter))),
      date('since', 'From'),
      date('until', 'To'),
      field('Order', select(Object.entries(orders), values.sort, (order) => set('sort', order, onOrder))),
      all,
    ]);
  }

  get isOn(): boolean {
    return Object.values(this.values).some(Boolean);
  }

  async listJobs(cursor = '', { state, limit }: { state?: JobState; limit?: number } = {}): ReturnType<JobSource['listJobs']> {
    const { values } = this;
    const own = (values.state || undefined) as JobState | undefined;
    if (own && state && own !== state) return { jobs: [], next: null };
    // The last day itself, too.
    const days = { since: beginOf(values.since), until: beginOf(values.until, 1) };
    return client.listJobs(cursor, { state: state ?? own, limit, volume: values.volume, ...days });
  }

  // Those that are searched for, in the order that is chosen.
  shown(jobs: readonly Job[], nameOf: (job: Job) => string): Job[] {
    const { state, search = '', sort } = this.values;
    const words = search.toLowerCase().split(/\s+/).filter(Boolean);
    const found = jobs.filter((job) => {
      const text = [nameOf(job), surfaceInWords(job.parameters), inWords(job.parameters)].join(' ').toLowerCase();
      return (!state || job.state === state) && words.every((word) => text.includes(word) || word === shortId(job.id) || word === job.id);
    });
    const compare = sort && sort in by ? by[sort as keyof typeof by] : null;
    return compare ? found.sort(compare) : found;
  }
}
