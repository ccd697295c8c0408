// What happens to jobs, in one stream for the whole client: a browser makes only six connections to a server over
// HTTP/1.1, and each stream keeps one.
import { delayAfter } from './busy';
import type { Connection } from './connection';
import { asApiError } from './problem';
import { sleep } from './sleep';
import type { JobChange } from './types';

// Server-sent events (WHATWG HTML, 9.2.6) without EventSource, which cannot carry a token. The data of each are one line.
export class EventData {
  private rest = '';

  // Those that this piece of text completes.
  take(text: string): string[] {
    const lines = (this.rest + text).split('\n');
    this.rest = lines.pop() ?? '';
    return lines.flatMap((line) => (line.startsWith('data:') ? [line.slice('data:'.length)] : []));
  }
}

export interface JobListener {
  onChange: (change: JobChange) => void;
  // The stream begins, for the first time or after a pause.
  onBegin: () => void;
  // The stream has ended or failed. Until it begins again, the listener has to ask.
  onPause: () => void;
}

const retryDelays = [500, 1000, 2000, 4000];
// If the daemon rejects the stream: it may be an old one, or all its streams are taken.
const refusedDelay = 15_000;
// The daemon sends something at least every 15 seconds.
const longestSilence = 40_000;

export class JobEvents {
  private readonly listeners = new Set<JobListener>();
  private running: AbortController | null = null;
  private isOpen = false;

  constructor(private readonly connection: Connection) {}

  // Calls the listener until the signal is aborted.
  listen(listener: JobListener, signal: AbortSignal): void {
    if (signal.aborted) return;
    this.listeners.add(listener);
    signal.addEventListener('abort', () => {
      this.listeners.delete(listener);
      if (this.listeners.size === 0) this.stop();
    });
    this.start();
  }

  get isTelling(): boolean {
    return this.isOpen;
  }

  // A hidden page leaves its connection to others, and calls this when it is seen again.
  start(): void {
    if (this.running || this.listeners.size === 0 || isHidden()) return;
    const running = new AbortController();
    this.running = running;
    void this.run(running.signal);
  }

  stop(): void {
    this.running?.abort();
    this.running = null;
    this.pause();
  }

  private pause(): void {
    this.isOpen = false;
    for (const listener of [...this.listeners]) listener.onPause();
  }

  private async run(signal: AbortSignal): Promise<void> {
    let failures = 0;
    while (!signal.aborted) {
      let pause = retryDelays[Math.min(failures, retryDelays.length - 1)] ?? 0;
      try {
        await this.read(signal);
        failures = 0;
      } catch (error) {
        if (signal.aborted) return;
        failures += 1;
        const failure = asApiError(error);
        if (!failure.isUnreachable) pause = delayAfter(failure, refusedDelay);
      }
      if (signal.aborted) return;
      this.pause();
      await sleep(pause, signal);
    }
  }

  private async read(signal: AbortSignal): Promise<void> {
    // Without waiting for a busy server: listeners ask in the meantime.
    const init = { signal, headers: { Accept: 'text/event-stream' }, retrySeconds: 0 };
    const answer = await this.connection.send('/v1/events', init);
    const reader = answer.body?.getReader();
    if (!reader) return;
    this.isOpen = true;
    for (const listener of [...this.listeners]) listener.onBegin();
    const data = new EventData();
    const decoder = new TextDecoder();
    for (;;) {
      const silence = setTimeout(() => void reader.cancel(), longestSilence);
      const { done, value } = await reader.read().finally(() => clearTimeout(silence));
      if (done) return;
      for (const text of data.take(decoder.decode(value, { stream: true }))) {
        const change = JSON.parse(text) as JobChange;
        for (const listener of [...this.listeners]) listener.onChange(change);
      }
    }
  }
}

// Always false in Node, which has no page.
export function isHidden(): boolean {
  return typeof document !== 'undefined' && document.hidden;
}
