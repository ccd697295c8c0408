// Following a job to its end. The stubbed daemon sends its responses in the order that a test chooses.
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Client } from '@/api/client';
import type { Job } from '@/api/types';
import { client } from '@/client';
import { WatchedJobs } from '@/job/watched';

const id = '0123456789abcdef';

class Daemon {
  private state = 'running';
  private readonly held: (() => void)[] = [];
  private stream: ReadableStreamDefaultController<Uint8Array> | null = null;
  questions = 0;
  // Statuses of the next responses.
  readonly refusals: number[] = [];
  retryAfter: Record<string, string> = {};
  holds = false;

  answer(address: string): Promise<Response> {
    if (new URL(address, 'http://127.0.0.1:8080').pathname === '/v1/events') {
      const body = new ReadableStream<Uint8Array>({ start: (controller) => void (this.stream = controller) });
      return Promise.resolve(new Response(body));
    }
    this.questions += 1;
    const status = this.refusals.shift();
    if (status !== undefined) return Promise.resolve(new Response('<html></html>', { status, headers: this.retryAfter }));
    const answer = Response.json({ id, state: this.state });
    if (!this.holds) return Promise.resolve(answer);
    return new Promise((resolve) => this.held.push(() => resolve(answer)));
  }

  release(): void {
    for (const give of this.held.splice(0)) give();
  }

  end(): void {
    this.state = 'succeeded';
    this.stream?.enqueue(new TextEncoder().encode(`data: ${JSON.stringify({ id, state: 'succeeded' })}\n\n`));
  }
}

let daemon: Daemon;
let over: AbortController;

beforeEach(() => {
  daemon = new Daemon();
  over = new AbortController();
  vi.stubGlobal('fetch', (address: string) => daemon.answer(address));
});

afterEach(() => {
  over.abort();
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

// What has been begun goes on as far as it can.
async function settled(): Promise<void> {
  for (let turn = 0; turn < 20; turn += 1) await new Promise((resolve) => setImmediate(resolve));
}

describe('a job that is followed', () => {
  it('ends when the stream says so', async () => {
    const seen: string[] = [];
    const job = client.follow(id, over.signal, ({ state }: Job) => seen.push(state));
    await settled();
    daemon.end();
    expect((await job).state).toBe('succeeded');
    expect(seen[0]).toBe('running');
  });

  it('ends where its end is told before the first answer, which still calls it running', async () => {
    // The stream is there already, as on a page that has shown other things before.
    client.follow('another', over.signal).catch(() => undefined);
    await settled();
    daemon.holds = true;
    const job = client.follow(id, over.signal, () => undefined);
    await settled();
    daemon.end();
    await settled();
    daemon.holds = false;
    daemon.release();
    expect((await job).state).toBe('succeeded');
  });

  it('is told of where it had ended before anybody knew its id', async () => {
    client.follow('another', over.signal).catch(() => undefined);
    await settled();
    daemon.end();
    await settled();
    const told: Job[] = [];
    new WatchedJobs((job) => told.push(job)).add(id);
    await settled();
    expect(told.map(({ state }) => state)).toEqual(['succeeded']);
  });

  it('is waited for while the server or a proxy before it says that it is busy or away', async () => {
    vi.useFakeTimers({ toFake: ['setTimeout', 'clearTimeout'] });
    daemon.refusals.push(408, 429, 502, 503, 504);
    const states: string[] = [];
    client.follow(id, over.signal, ({ state }) => states.push(state)).catch((error: Error) => states.push(error.message));
    for (let second = 0; second < 8; second += 1) {
      await vi.advanceTimersByTimeAsync(1000);
      await settled();
    }
    expect(daemon.refusals).toEqual([]);
    expect(states).toEqual(['running']);
  });

  it('is left alone as long as the server says, also by a client that does not wait itself', async () => {
    vi.useFakeTimers({ toFake: ['setTimeout', 'clearTimeout'] });
    // It asks at once, and when the stream begins.
    daemon.refusals.push(503, 503);
    daemon.retryAfter = { 'Retry-After': '30' };
    const states: string[] = [];
    const hasty = new Client({ server: '', retrySeconds: 0 });
    const job = hasty.follow(id, over.signal, ({ state }) => states.push(state));
    job.catch(() => undefined);
    await settled();
    await settled();
    const { questions } = daemon;
    await vi.advanceTimersByTimeAsync(29_000);
    await settled();
    expect([daemon.questions, states]).toEqual([questions, []]);
    await vi.advanceTimersByTimeAsync(1000);
    await settled();
    expect(states).toEqual(['running']);
  });

  it('is asked for once where nothing more is told', async () => {
    client.follow(id, over.signal).catch(() => undefined);
    await settled();
    const { questions } = daemon;
    await settled();
    expect(daemon.questions).toBe(questions);
  });
});
