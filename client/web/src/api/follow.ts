// Follows a job to its end: by the stream of all jobs, and by requests while there is no stream.
import { delayAfter } from './busy';
import type { Client } from './client';
import { isHidden } from './job_events';
import { asApiError, isPassing, type ApiError } from './problem';
import { isFinal, type Job, type JobChange } from './types';

// The time between two requests while there is no stream. A hidden page asks less often.
const askEvery = 1000;
const askHidden = 4000;

// The job with what the change says. A change of another job changes nothing.
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
    private readonly client: Client,
    private readonly id: string,
    private readonly onChange: (job: Job) => void,
    private readonly end: End,
  ) {}

  start(signal: AbortSignal | undefined): void {
    if (signal?.aborted) {
      this.fail(signal.reason);
      return;
    }
    // The listener goes with the follower, since the caller's signal may live much longer.
    signal?.addEventListener('abort', () => this.fail(signal.reason), { signal: this.over.signal });
    this.over.signal.addEventListener('abort', () => clearTimeout(this.timer));
    this.client.events.listen(
      {
        onBegin: () => void this.ask(),
        onPause: () => this.askLater(),
        onChange: (change) => this.take(change),
      },
      this.over.signal,
    );
    void this.ask();
  }

  private fail(reason: unknown): void {
    this.end.reject(reason);
    this.over.abort();
  }

  private take(change: JobChange): void {
    if (change.id !== this.id) return;
    // The change may overtake the response to the first request, which still calls the job running.
    if (isFinal(change.state)) void this.ask();
    else if (this.current) this.show(merged(this.current, change));
  }

  private show(job: Job): void {
    this.current = job;
    try {
      this.onChange(job);
    } catch (error) {
      // Otherwise the caller's fault would look like one of the connection, and be retried.
      this.fail(error);
    }
  }

  private askLater(failure: ApiError | null = null): void {
    clearTimeout(this.timer);
    const delay = isHidden() ? askHidden : askEvery;
    this.timer = setTimeout(() => void this.ask(), failure ? delayAfter(failure, delay) : delay);
  }

  private async ask(): Promise<void> {
    const { signal } = this.over;
    // The response may be older than what happens while it is on its way.
    this.asksAgain = this.isAsking;
    if (this.isAsking || signal.aborted) return;
    this.isAsking = true;
    let failure: ApiError | null = null;
    try {
      const job = await this.client.getJob(this.id, 0, signal);
      if (signal.aborted) return;
      this.show(job);
      if (isFinal(job.state)) {
        this.end.resolve(job);
        this.over.abort();
      }
    } catch (error) {
      failure = asApiError(error);
      if (!signal.aborted && !isPassing(failure.status)) this.fail(failure);
    } finally {
      this.isAsking = false;
      if (this.asksAgain) void this.ask();
      else if (!signal.aborted && (failure || !this.client.events.isTelling)) this.askLater(failure);
    }
  }
}

export function follow(
  client: Client,
  id: string,
  signal: AbortSignal | undefined,
  onChange: (job: Job) => void,
): Promise<Job> {
  return new Promise((resolve, reject) => {
    new Follower(client, id, onChange, { resolve, reject }).start(signal);
  });
}
