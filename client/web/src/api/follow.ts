// A job's way to its end: told by the stream of all jobs, asked for where there is none. A lost connection
// is waited for.
import { getJob } from './client';
import { isHidden, jobEvents } from './job_events';
import { asApiError } from './problem';
import { isFinal, type Job, type JobChange } from './types';

// Between two questions while nothing is told; a page that nobody sees asks less often.
const askEvery = 1000;
const askHidden = 4000;

// What is told adds to the job; what is told of another one is none of it.
export function merged(job: Job, change: JobChange): Job {
  return change.id === job.id ? { ...job, ...change } : job;
}

interface End {
  resolve: (job: Job) => void;
  reject: (error: unknown) => void;
}

class Follower {
  private readonly over = new AbortController();
  private current: Job | null = null;
  private isAsking = false;
  private asksAgain = false;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly id: string,
    signal: AbortSignal,
    private readonly onChange: (job: Job) => void,
    private readonly end: End,
  ) {
    signal.addEventListener('abort', () => this.over.abort());
    this.over.signal.addEventListener('abort', () => clearTimeout(this.timer));
    jobEvents.listen(
      {
        onBegin: () => void this.ask(),
        onPause: () => this.askLater(),
        onChange: (change) => this.told(change),
      },
      this.over.signal,
    );
    void this.ask();
  }

  private told(change: JobChange): void {
    if (change.id !== this.id) return;
    // The end may overtake the first answer, which does not know of it.
    if (isFinal(change.state)) void this.ask();
    else if (this.current) this.show(merged(this.current, change));
  }

  private show(job: Job): void {
    this.current = job;
    this.onChange(job);
  }

  private askLater(): void {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.ask(), isHidden() ? askHidden : askEvery);
  }

  private async ask(): Promise<void> {
    const { signal } = this.over;
    // What happens meanwhile may not be in the answer.
    this.asksAgain = this.isAsking;
    if (this.isAsking || signal.aborted) return;
    this.isAsking = true;
    let hasFailed = false;
    try {
      const job = await getJob(this.id, 0, signal);
      if (signal.aborted) return;
      this.show(job);
      if (isFinal(job.state)) {
        this.over.abort();
        this.end.resolve(job);
      }
    } catch (error) {
      hasFailed = true;
      if (!signal.aborted) this.failed(error);
    } finally {
      this.isAsking = false;
      if (this.asksAgain) void this.ask();
      else if (!signal.aborted && (hasFailed || !jobEvents.isTelling)) this.askLater();
    }
  }

  private failed(error: unknown): void {
    const refusal = asApiError(error);
    if (refusal.isUnreachable || refusal.status === 503 || refusal.status === 429) return;
    this.over.abort();
    this.end.reject(refusal);
  }
}

// Calls back with every change, the end included, and resolves with the job as it ended. Rejects with
// ApiError when the job is gone; never does either once the signal has ended.
export function follow(id: string, signal: AbortSignal, onChange: (job: Job) => void): Promise<Job> {
  return new Promise((resolve, reject) => {
    new Follower(id, signal, onChange, { resolve, reject });
  });
}
