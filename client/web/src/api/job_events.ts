// What happens to jobs, in one stream for the whole page: a browser makes only six connections to a server
// over HTTP/1.1, and a stream keeps one.
import { send } from './client';
import { EventParser } from './events';
import { asApiError } from './problem';
import type { JobChange } from './types';

export interface JobListener {
  onChange: (change: JobChange) => void;
  // The stream begins, for the first time or after a pause in which nothing was told.
  onBegin: () => void;
  // Nothing is told for the time being: who wants to know has to ask.
  onPause: () => void;
}

const retryDelays = [500, 1000, 2000, 4000];
// When the daemon has no stream, or none to spare.
const refusedDelay = 15_000;
// The daemon says something every 15 seconds at least.
const longestSilence = 40_000;

export class JobEvents {
  private readonly listeners = new Set<JobListener>();
  private running: AbortController | null = null;
  private isOpen = false;

  // Tells the listener until the signal ends.
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

  // A page that nobody sees leaves its connection to the others.
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
        if (!asApiError(error).isUnreachable) pause = refusedDelay;
      }
      if (signal.aborted) return;
      this.pause();
      await sleep(pause, signal);
    }
  }

  private async read(signal: AbortSignal): Promise<void> {
    const answer = await send('/v1/events', { signal, headers: { Accept: 'text/event-stream' } });
    const reader = answer.body?.getReader();
    if (!reader) return;
    this.isOpen = true;
    for (const listener of [...this.listeners]) listener.onBegin();
    const parser = new EventParser();
    const decoder = new TextDecoder();
    for (;;) {
      const silence = setTimeout(() => void reader.cancel(), longestSilence);
      const { done, value } = await reader.read().finally(() => clearTimeout(silence));
      if (done) return;
      for (const event of parser.take(decoder.decode(value, { stream: true }))) {
        const change = JSON.parse(event.data) as JobChange;
        for (const listener of [...this.listeners]) listener.onChange(change);
      }
    }
  }
}

export const jobEvents = new JobEvents();

// Where there is no page, somebody waits.
export function isHidden(): boolean {
  return typeof document !== 'undefined' && document.hidden;
}

export function watchVisibility(): void {
  document.addEventListener('visibilitychange', () => {
    if (document.hidden) jobEvents.stop();
    else jobEvents.start();
  });
}

export function sleep(milliseconds: number, signal?: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, milliseconds);
    signal?.addEventListener('abort', () => {
      clearTimeout(timer);
      resolve();
    });
  });
}
