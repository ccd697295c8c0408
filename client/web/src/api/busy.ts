// Busy servers: how long they ask a client to wait, and how long it waits.

// The part of Headers that is read here; not every project has that type.
export interface HeaderValues {
  get(name: string): string | null;
}

// In seconds, as Retry-After is.
export const usualLimit = 600;
// For the last request of a caller that has given up.
export const partingLimit = 2;
// Without Retry-After each pause is twice as long as the one before.
const firstPause = 0.5;
const longestPause = 15;
const leastJitter = 0.5;
// Timers take no longer time than this.
const mostSeconds = 2_000_000;

export function isBusy(status: number): boolean {
  return status === 429 || status === 503;
}

// The seconds of the Retry-After header, which has a number or a date. The two machines' clocks may differ, so a date
// is compared with the response's own, if the client may read that.
export function retryAfterOf(headers: HeaderValues): number | undefined {
  const value = headers.get('Retry-After')?.trim() ?? '';
  if (/^\d+(\.\d+)?$/.test(value)) return Number(value);
  const then = /^[A-Za-z]/.test(value) ? Date.parse(value) : NaN;
  if (Number.isNaN(then)) return undefined;
  const now = Date.parse(headers.get('Date') ?? '');
  return Math.max(0, (then - (Number.isNaN(now) ? Date.now() : now)) / 1000);
}

// The milliseconds after which something that failed may be tried again by itself: `usual`, or later if the server wants so.
export function delayAfter({ retryAfter = 0 }: { retryAfter?: number }, usual: number): number {
  return Math.max(usual, 1000 * Math.min(retryAfter, mostSeconds));
}

export function checkedLimit(seconds: number): number {
  if (!(seconds >= 0)) throw new RangeError(`retrySeconds must be a number of seconds from 0 up. It is ${seconds}.`);
  return seconds;
}

// The pauses of one request while the server is busy: so many seconds in all, from its first refusal.
export class BusyPauses {
  private readonly limit: number;
  private end: number | null = null;
  private pause = firstPause;

  constructor(limit: number) {
    this.limit = Math.min(limit, mostSeconds);
  }

  // The seconds after which the request should be sent again. Null if that is too late.
  next(headers: HeaderValues): number | null {
    const now = Date.now() / 1000;
    this.end ??= now + this.limit;
    const pause = this.pauseOf(retryAfterOf(headers));
    return now + pause > this.end ? null : pause;
  }

  // Clients that were refused at the same time must not return at the same time.
  private pauseOf(asked: number | undefined): number {
    // A date that has passed says as little as no header.
    if (asked) return asked + Math.random() * Math.max(asked / 4, leastJitter);
    const { pause } = this;
    this.pause = Math.min(2 * pause, longestPause);
    return pause / 2 + (Math.random() * pause) / 2;
  }
}
