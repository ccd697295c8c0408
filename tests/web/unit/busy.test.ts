// Servers that are busy: every request waits as long as they say, and none is lost.
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { retryAfterOf } from '@/api/busy';
import { ApiError, Client } from '@/api/index';
import { Scope } from '@/ui/signal';
import { Daemon, eventually, id } from './daemon';

// Pauses take no time, and are recorded in seconds.
const clock = vi.hoisted(() => ({ pauses: [] as number[], onPause: (): void => undefined }));

vi.mock('@/api/sleep', () => ({
  sleep: async (milliseconds: number) => {
    clock.pauses.push(milliseconds / 1000);
    vi.setSystemTime(Date.now() + milliseconds);
    clock.onPause();
    await new Promise((resolve) => setImmediate(resolve));
  },
}));

type Asked = [method: string, path: string, body: unknown, key: string | null];

const daemon = new Daemon('first');
let client: Client;
// The response that the server sends instead, to the first requests of that number.
let refusal: { status: number; headers: Record<string, string>; times: number };
let asked: Asked[];
let refused: Map<string, number>;

function answer(address: string, init: RequestInit, real: typeof fetch): Promise<Response> {
  init.signal?.throwIfAborted();
  const headers = new Headers(init.headers);
  const path = address.slice(daemon.address.length);
  const what: Asked = [init.method ?? 'GET', path, init.body, headers.get('Idempotency-Key')];
  asked.push(what);
  const name = `${what[0]} ${path}`;
  const times = refused.get(name) ?? 0;
  if (times >= refusal.times) return real(address, init);
  refused.set(name, times + 1);
  const body = JSON.stringify({ title: 'Busy', detail: 'come again', status: refusal.status });
  return Promise.resolve(new Response(what[0] === 'HEAD' ? null : body, refusal));
}

beforeEach(async () => {
  vi.useFakeTimers({ toFake: ['Date'] });
  await daemon.start();
  clock.pauses = [];
  clock.onPause = () => undefined;
  refusal = { status: 429, headers: { 'Retry-After': '7' }, times: 1 };
  asked = [];
  refused = new Map();
  client = new Client({ server: daemon.address });
  const real = fetch;
  vi.stubGlobal('fetch', (address: string, init: RequestInit) => answer(address, init, real));
});

afterEach(async () => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
  vi.restoreAllMocks();
  await daemon.stop();
});

async function rejectionOf(promise: Promise<unknown>): Promise<ApiError> {
  const error: unknown = await promise.then(
    () => 'it was resolved',
    (reason: unknown) => reason,
  );
  expect(error).toBeInstanceOf(ApiError);
  return error as ApiError;
}

describe('Retry-After', () => {
  it('is a number of seconds or a date', () => {
    for (const [value, seconds] of [
      ['0', 0],
      ['7', 7],
      [' 120 ', 120],
      ['Sat, 28 Nov 2026 09:41:30 GMT', 90],
      ['Sat, 28 Nov 2026 09:39:00 GMT', 0],
      ['', undefined],
      ['soon', undefined],
    ] as const) {
      const headers = new Headers({ 'Retry-After': value, Date: 'Sat, 28 Nov 2026 09:40:00 GMT' });
      expect(retryAfterOf(headers), value).toBe(seconds);
    }
    expect(retryAfterOf(new Headers())).toBeUndefined();
  });

  it("is compared with this machine's clock if the page may not read the response's date", () => {
    vi.setSystemTime('2026-11-28T09:40:00Z');
    expect(retryAfterOf(new Headers({ 'Retry-After': 'Sat, 28 Nov 2026 09:41:30 GMT' }))).toBe(90);
  });
});

describe('while the server is busy', () => {
  it('every request waits and is repeated as it was', async () => {
    daemon.state = 'succeeded';
    await client.upload(new Uint8Array(9), { name: 'head.nii.gz' });
    await client.upload(new Uint8Array(9), { kept: 'f00d' });
    const { id: submitted } = await client.submitJob({ volume: 'a', iso: 60 });
    const job = await client.follow(submitted);
    expect((await client.meshOf(job, 'glb')).byteLength).toBe(4);
    await client.labelsOfJob(id);
    await client.wallsOfJob(id);
    await client.labelsOf(id, 0);
    await client.cancelJob(id);
    // A job that has ended meanwhile is not to be erased.
    expect(daemon.query.get('erase')).toBe('false');
    expect(refused.size).toBeGreaterThan(8);
    // The stream of jobs is not waited for. It is asked for after 15 seconds.
    refused.delete('GET /v1/events');
    const pauses = clock.pauses.filter((pause) => pause !== 15);
    expect(pauses).toHaveLength(refused.size);
    for (const pause of pauses) expect(pause >= 7 && pause <= 8.75, String(pause)).toBe(true);
    // Each was refused once, and then sent as it was, the job with the same key.
    for (const name of refused.keys()) {
      const [first, second] = asked.filter(([method, path]) => `${method} ${path}` === name);
      expect(second, name).toEqual(first);
    }
    expect(asked.find(([, path]) => path === '/v1/jobs')?.[3]).toMatch(/^[0-9a-f]{32}$/);
    expect(daemon.uploaded.length).toBe(9);
  });

  it('it is tried for ten minutes, and the error says when to come again', async () => {
    refusal.times = Infinity;
    const error = await rejectionOf(client.getJob(id));
    expect(error).toMatchObject({ status: 429, retryAfter: 7, detail: 'come again' });
    const whole = clock.pauses.reduce((sum, pause) => sum + pause, 0);
    expect(whole > 590 && whole <= 600, String(whole)).toBe(true);
    expect(asked).toHaveLength(clock.pauses.length + 1);
  });

  it('the limit can be set', async () => {
    vi.spyOn(Math, 'random').mockReturnValue(0.999);
    refusal = { ...refusal, status: 503, times: Infinity };
    for (const [retrySeconds, tries] of [
      [0, 1],
      [6, 1],
      [20, 3],
    ] as const) {
      asked = [];
      await rejectionOf(new Client({ server: daemon.address, retrySeconds }).getJob(id));
      expect(asked, String(retrySeconds)).toHaveLength(tries);
    }
    for (const retrySeconds of [-1, NaN]) {
      expect(() => new Client({ server: daemon.address, retrySeconds })).toThrow(RangeError);
    }
  });

  it('an upload in parts ends with the limit, too', async () => {
    refusal.times = 0;
    const uploading = new Client({ server: daemon.address, retrySeconds: 30 });
    const real = fetch;
    vi.stubGlobal('fetch', (address: string, init: RequestInit) => {
      if (init.method === 'PATCH') refusal.times = Infinity;
      return real(address, init);
    });
    expect(await rejectionOf(uploading.upload(new Uint8Array(9)))).toMatchObject({ status: 429, retryAfter: 7 });
    const waited = clock.pauses.reduce((sum, pause) => sum + pause, 0);
    // And 2 seconds for the request that tells the server so.
    expect(waited > 20 && waited <= 32, String(clock.pauses)).toBe(true);
  });

  it('its time is no outage of an upload', async () => {
    const cut = (): never => {
      throw new TypeError('fetch failed');
    };
    const state = (): Response => new Response(null, { status: 204, headers: { 'Upload-Offset': '0', 'Upload-Complete': '?0' } });
    const busy = (): Response => new Response(null, { status: 503, headers: { 'Retry-After': '100' } });
    const stored = (): Response => new Response('{"id":"a"}', { status: 201, headers: { Location: '/v1/uploads/a' } });
    const answers = [stored, cut, busy, state, cut, busy, state, stored];
    vi.stubGlobal('fetch', () => Promise.resolve().then(() => (answers.shift() ?? cut)()));
    const { volumes } = await client.upload(new Uint8Array(9));
    expect(volumes[0]?.volume).toEqual({ id: 'a' });
    expect(answers).toEqual([]);
  });

  it('nobody begins to wait for what comes too late', async () => {
    refusal = { status: 503, headers: { 'Retry-After': '3600' }, times: Infinity };
    expect((await rejectionOf(client.getJob(id))).retryAfter).toBe(3600);
    expect(clock.pauses).toEqual([]);
  });

  it('pauses grow if it does not say how long', async () => {
    refusal = { status: 503, headers: {}, times: Infinity };
    expect((await rejectionOf(client.getJob(id))).retryAfter).toBeUndefined();
    [0.5, 1, 2, 4, 8, 15, 15, 15].forEach((longest, at) => {
      const pause = clock.pauses[at] ?? NaN;
      expect(pause >= longest / 2 && pause <= longest, String(clock.pauses.slice(0, 8))).toBe(true);
    });
  });

  it('clients that were refused together return apart', async () => {
    refusal.headers = { 'Retry-After': '1' };
    await Promise.all(
      Array.from({ length: 60 }, () => {
        refused.clear();
        return client.getJob(id);
      }),
    );
    expect(clock.pauses).toHaveLength(60);
    for (const pause of clock.pauses) expect(pause >= 1 && pause <= 1.5).toBe(true);
    expect(Math.max(...clock.pauses) - Math.min(...clock.pauses)).toBeGreaterThan(0.25);
  });

  it('says so as long as anything waits, and to who uploads', async () => {
    const told: number[] = [];
    const seen: boolean[] = [];
    client.connection.busy.subscribe((isBusy) => seen.push(isBusy));
    clock.onPause = () => expect(client.connection.busy.value).toBe(true);
    await Promise.all([client.upload(new Uint8Array(9), { onBusy: (seconds) => told.push(seconds) }), client.getJob(id)]);
    expect(seen[0]).toBe(true);
    expect(client.connection.busy.value).toBe(false);
    // The beginning of the upload, and its part.
    expect(told).toHaveLength(2);
    expect(told.every((seconds) => seconds >= 7)).toBe(true);
  });

  it('other errors are not retried', async () => {
    refusal.times = Infinity;
    for (const status of [400, 404, 409, 410, 413, 422, 500, 502, 507]) {
      refusal.status = status;
      asked = [];
      expect((await rejectionOf(client.getJob(id))).status).toBe(status);
      expect(asked).toHaveLength(1);
    }
    expect(clock.pauses).toEqual([]);
  });

  it('an aborted signal ends the wait', async () => {
    refusal.times = Infinity;
    for (const ask of [
      (signal: AbortSignal) => client.getJob(id, 0, signal),
      (signal: AbortSignal) => client.upload(new Uint8Array(9), { signal }),
      (signal: AbortSignal) => client.follow(id, signal),
    ]) {
      const over = new AbortController();
      clock.onPause = () => over.abort(new Error('enough'));
      await expect(ask(over.signal)).rejects.toThrow('enough');
    }
    // The server is told that the upload was given up.
    await eventually(() => expect(client.connection.busy.value).toBe(false));
  });

  it('the stream of jobs is left alone as long as the server says, and the job is followed all the same', async () => {
    daemon.state = 'succeeded';
    refusal = { status: 503, headers: { 'Retry-After': '60' }, times: 2 };
    const over = new AbortController();
    client.events.listen({ onBegin: () => over.abort(), onPause: () => undefined, onChange: () => undefined }, over.signal);
    await eventually(() => expect(over.signal.aborted).toBe(true));
    expect(clock.pauses.slice(0, 2)).toEqual([60, 60]);
    expect((await client.follow(id)).state).toBe('succeeded');
  });
});

describe('the pause itself', () => {
  it('ends as soon as its signal is aborted', async () => {
    const { sleep } = await vi.importActual<typeof import('@/api/sleep')>('@/api/sleep');
    const over = new AbortController();
    const slept = sleep(10_000_000, over.signal);
    over.abort();
    await slept;
    await sleep(10_000_000, over.signal);
  });
});

describe('a page that refreshes a list', () => {
  it('begins no other refresh while one waits', async () => {
    vi.useRealTimers();
    vi.useFakeTimers();
    vi.stubGlobal('document', { hidden: false });
    const scope = new Scope();
    const ends: (() => void)[] = [];
    scope.repeat(1000, () => new Promise((resolve) => ends.push(resolve)));
    await vi.advanceTimersByTimeAsync(5500);
    expect(ends).toHaveLength(1);
    ends[0]?.();
    await vi.advanceTimersByTimeAsync(1000);
    expect(ends).toHaveLength(2);
    scope.end();
  });
});

describe('forty uploads at once', () => {
  // Takes two uploads at a time, and refuses the others.
  let server: Server;
  let refusals = 0;
  let active = 0;
  let most = 0;
  const stored: string[] = [];
  // The first two uploads wait until others have come.
  const held: (() => void)[] = [];

  beforeEach(async () => {
    vi.unstubAllGlobals();
    server = createServer((request, response) => {
      if (request.method !== 'PATCH') {
        response.writeHead(201, { Location: '/v1/uploads/a' }).end();
      } else if (active === 2) {
        refusals += 1;
        for (const end of held.splice(0)) end();
        request.resume();
        response.writeHead(429, { 'Retry-After': '1' }).end('{"title":"Too many requests","detail":"too many uploads"}');
      } else {
        active += 1;
        most = Math.max(most, active);
        const pieces: Buffer[] = [];
        request.on('data', (piece: Buffer) => pieces.push(piece));
        const end = (): void => {
          active -= 1;
          stored.push(Buffer.concat(pieces).toString());
          response.writeHead(201).end('{"id":"a"}');
        };
        request.on('end', () => (refusals > 0 ? end() : held.push(end)));
      }
    });
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  });
  afterEach(() => void server.close());

  it('all arrive', async () => {
    const many = new Client({ server: `http://127.0.0.1:${(server.address() as AddressInfo).port}` });
    const names = Array.from({ length: 40 }, (_, number) => `volume ${number}`);
    await Promise.all(names.map((name) => many.upload(new TextEncoder().encode(name))));
    expect(stored.sort()).toEqual(names.sort());
    expect(most).toBe(2);
    expect(refusals).toBeGreaterThan(0);
  });
});
