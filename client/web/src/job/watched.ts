// Jobs that this tab has started: a person who went elsewhere is told when one has ended.
import { client } from '../client';
import { isGone } from '../api/problem';
import type { Job } from '../api/types';

const key = 'isomesh.jobs';
const most = 50;

export class WatchedJobs {
  // `tell` is called once for each that has ended.
  constructor(private readonly tell: (job: Job) => void) {}

  // As the page begins: those from before it was loaded anew.
  start(): void {
    for (const id of this.ids) this.follow(id);
  }

  add(id: string): void {
    if (this.ids.includes(id)) return;
    this.ids = [...this.ids, id].slice(-most);
    this.follow(id);
  }

  private get ids(): string[] {
    return (sessionStorage.getItem(key) ?? '').split(',').filter(Boolean);
  }

  private set ids(ids: readonly string[]) {
    sessionStorage.setItem(key, ids.join(','));
  }

  private follow(id: string): void {
    const forget = (): void => void (this.ids = this.ids.filter((other) => other !== id));
    client.follow(id).then(
      (job) => {
        forget();
        this.tell(job);
      },
      // One that is gone is waited for no more; others are after the page was loaded anew.
      (error: unknown) => isGone(error) && forget(),
    );
  }
}
