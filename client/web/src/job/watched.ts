// Jobs that this tab has started: a person who went elsewhere is told when one has ended.
import { client } from '../client';
import { isGone } from '../api/problem';
import { isFinal, type Job } from '../api/types';

const key = 'isomesh.jobs';
const most = 50;

export class WatchedJobs {
  private listening: AbortController | null = null;

  // `tell` is called once for each that has ended.
  constructor(private readonly tell: (job: Job) => void) {}

  // As the page begins: those from before it was loaded anew.
  start(): void {
    if (this.ids.length > 0) this.listen();
  }

  add(id: string): void {
    this.ids = [...this.ids.filter((other) => other !== id), id].slice(-most);
    this.listen();
    // Its end may have been told before its id was known.
    void this.look(id);
  }

  private get ids(): string[] {
    return (sessionStorage.getItem(key) ?? '').split(',').filter(Boolean);
  }

  private set ids(ids: readonly string[]) {
    sessionStorage.setItem(key, ids.join(','));
    if (ids.length > 0) return;
    this.listening?.abort();
    this.listening = null;
  }

  private listen(): void {
    if (this.listening) return;
    this.listening = new AbortController();
    client.events.listen(
      {
        // Jobs that ended while there were no events.
        onBegin: () => {
          for (const id of this.ids) void this.look(id);
        },
        onChange: ({ id, state }) => {
          if (isFinal(state) && this.ids.includes(id)) void this.look(id);
        },
        onPause: () => undefined,
      },
      this.listening.signal,
    );
  }

  private async look(id: string): Promise<void> {
    try {
      const job = await client.getJob(id);
      if (!isFinal(job.state) || !this.ids.includes(id)) return;
      this.ids = this.ids.filter((other) => other !== id);
      this.tell(job);
    } catch (error) {
      // One that is gone is waited for no more; of any other the stream tells again.
      if (isGone(error)) this.ids = this.ids.filter((other) => other !== id);
    }
  }
}
