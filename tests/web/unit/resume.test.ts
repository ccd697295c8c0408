// Uploads that continue after their connection broke, against a daemon as openapi.yaml describes it.
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { ApiError, Client } from '@/api/index';
import { eventually } from './daemon';

const place = '/v1/uploads/0123';
const whole = new Blob([Uint8Array.from({ length: 10_000_000 }, (_, at) => (at * 7919) >> 8)]);

class Daemon {
  readonly asked: string[] = [];
  bytes = new Uint8Array();
  isWhole = false;
  // Of so many parts the connection breaks after some of their bytes have come.
  cuts = 0;
  // The connection breaks before the last response, or within it.
  lastUnheard: 'whole' | 'body' | null = null;
  refusal: Response | null = null;
  isCancelled = false;
  // Is called with the number of the part, from 1.
  atPart: (part: number) => void = () => undefined;

  async answer(address: string, init: RequestInit): Promise<Response> {
    init.signal?.throwIfAborted();
    const url = new URL(address);
    const method = init.method ?? 'GET';
    this.asked.push(`${method} ${url.pathname}${url.searchParams.has('upload') ? '?upload' : ''}`);
    const headers = new Headers(init.headers);
    if (this.isCancelled && url.pathname === place) {
      // A request that sends to it breaks, and HEAD has no body.
      if (method === 'PATCH') throw new TypeError('fetch failed');
      const problem = JSON.stringify({ title: 'Cancelled', status: 409, detail: 'the upload was cancelled' });
      return new Response(method === 'HEAD' ? null : problem, { status: 409 });
    }
    if (method === 'HEAD') return new Response(null, { status: 204, headers: this.state() });
    if (method === 'DELETE') return new Response(null, { status: 204 });
    if (method === 'PATCH') return this.append(headers, new Uint8Array(await (init.body as Blob).arrayBuffer()));
    if (url.searchParams.has('upload')) return this.volume(200);
    if (init.body) {
      expect((init.body as Blob).size).toBe(whole.size);
      return this.volume(201);
    }
    expect(headers.get('Upload-Length')).toBe(String(whole.size));
    return new Response(null, { status: 201, headers: { Location: place } });
  }

  private append(headers: Headers, part: Uint8Array): Response {
    if (this.refusal) return this.refusal;
    this.atPart(this.asked.filter((each) => each === `PATCH ${place}`).length);
    expect(headers.get('Upload-Offset')).toBe(String(this.bytes.length));
    const isCut = this.cuts > 0;
    if (isCut) this.cuts -= 1;
    const came = isCut ? part.subarray(0, part.length >> 1) : part;
    const bytes = new Uint8Array(this.bytes.length + came.length);
    bytes.set(this.bytes);
    bytes.set(came, this.bytes.length);
    this.bytes = bytes;
    this.isWhole = !isCut && headers.get('Upload-Complete') === '?1';
    if (isCut || (this.isWhole && this.lastUnheard === 'whole')) throw new TypeError('fetch failed');
    if (this.isWhole && this.lastUnheard === 'body') {
      const cut = new ReadableStream({ pull: (controller) => controller.error(new TypeError('terminated')) });
      return new Response(cut, { status: 201 });
    }
    return this.isWhole ? this.volume(201) : new Response(null, { status: 204, headers: this.state() });
  }

  private state(): Record<string, string> {
    return { 'Upload-Offset': String(this.bytes.length), 'Upload-Complete': this.isWhole ? '?1' : '?0' };
  }

  private volume(status: number): Response {
    return new Response(JSON.stringify({ id: 'abc' }), { status, headers: { 'Upload-Complete': '?1' } });
  }
}

describe('upload in parts', () => {
  const client = new Client({ server: 'http://127.0.0.1:8080/' });
  let daemon: Daemon;

  beforeEach(() => {
    daemon = new Daemon();
    vi.stubGlobal('fetch', (address: string, init: RequestInit) => daemon.answer(address, init));
  });
  afterEach(() => {
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  function passSeconds(seconds: number): void {
    vi.setSystemTime(Date.now() + 1000 * seconds);
  }

  it('goes on where it broke, and tells how far it is', async () => {
    daemon.cuts = 2;
    const told: number[] = [];
    const { volumes } = await client.upload(whole, { onProgress: (sent) => told.push(sent) });
    expect(volumes).toEqual([{ member: '', status: 201, volume: { id: 'abc' }, problem: null }]);
    expect(Buffer.compare(daemon.bytes, new Uint8Array(await whole.arrayBuffer()))).toBe(0);
    expect(daemon.asked.filter((each) => each.startsWith('HEAD'))).toHaveLength(2);
    expect(told).toEqual([...told].sort((a, b) => a - b));
    expect(told.length).toBeGreaterThan(3);
    expect(told.at(-1)).toBe(whole.size);
  });

  it.each(['whole', 'body'] as const)('asks for the answer that was not heard: %s', async (unheard) => {
    daemon.lastUnheard = unheard;
    const { volumes } = await client.upload(whole);
    expect(volumes[0]?.volume).toEqual({ id: 'abc' });
    expect(daemon.asked.at(-1)).toBe('POST /v1/volumes?upload');
  });

  it('gives back what the daemon refuses', async () => {
    const problem = { title: 'The volume cannot be used', status: 422, detail: 'slice 41 of 93 is missing' };
    daemon.refusal = new Response(JSON.stringify(problem), { status: 422, headers: { 'Isomesh-Upload': '0123' } });
    const refused = await client.upload(whole).catch((error: unknown) => error);
    expect(refused).toBeInstanceOf(ApiError);
    expect(refused).toMatchObject({ status: 422, detail: problem.detail, remedy: { kept: '0123' } });
  });

  it('is not sent again if somebody has cancelled it', async () => {
    daemon.isCancelled = true;
    const cancelled = await client.upload(whole).catch((error: unknown) => error);
    expect(cancelled).toBeInstanceOf(ApiError);
    expect(cancelled).toMatchObject({ status: 409, detail: 'the upload was cancelled' });
    expect(daemon.asked).toEqual(['POST /v1/volumes', `PATCH ${place}`, `HEAD ${place}`, `GET ${place}`]);
  });

  it('comes in one piece where its parts are not known', async () => {
    daemon.refusal = new Response('{}', { status: 410 });
    const { volumes } = await client.upload(whole);
    expect(volumes[0]?.volume).toEqual({ id: 'abc' });
    expect(daemon.asked).toEqual(['POST /v1/volumes', `PATCH ${place}`, 'POST /v1/volumes']);
  });

  it('goes on after a part that got on for minutes before it broke', async () => {
    vi.useFakeTimers({ toFake: ['Date'] });
    daemon.cuts = 1;
    daemon.atPart = (part) => {
      if (part === 1) throw new TypeError('fetch failed');
      if (part === 2) passSeconds(90);
    };
    const { volumes } = await client.upload(whole);
    expect(volumes[0]?.volume).toEqual({ id: 'abc' });
  });

  it('is given up after a minute without progress, but not before the daemon was asked', async () => {
    vi.useFakeTimers({ toFake: ['Date'] });
    daemon.atPart = (part) => {
      if (part === 2) passSeconds(60);
      throw new TypeError('fetch failed');
    };
    const lost = await client.upload(whole).catch((error: unknown) => error);
    expect(lost).toMatchObject({ isUnreachable: true });
    expect(daemon.asked).toEqual(['POST /v1/volumes', `PATCH ${place}`, `HEAD ${place}`, `PATCH ${place}`, `HEAD ${place}`]);
  });

  it('is given up by who does not want it any more', async () => {
    const over = new AbortController();
    daemon.cuts = 1000;
    const refused = client.upload(whole, { signal: over.signal }).catch((error: unknown) => error);
    await eventually(() => expect(daemon.asked).toContain(`HEAD ${place}`));
    over.abort();
    expect(await refused).toBeInstanceOf(DOMException);
    await eventually(() => expect(daemon.asked.at(-1)).toBe(`DELETE ${place}`));
  });
});
