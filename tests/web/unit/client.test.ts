// Clients and real HTTP servers in one process.
import { File } from 'node:buffer';
import * as fs from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { adviceFor, ApiError, Client, type Job } from '@/api/index';
import { Connection } from '@/api/connection';
import { Daemon, eventually, id } from './daemon';

let first: Daemon;
let second: Daemon;
let client: Client;

beforeEach(async () => {
  first = new Daemon('first');
  second = new Daemon('second');
  await Promise.all([first.start(), second.start()]);
  client = new Client({ server: first.address });
});

afterEach(async () => {
  vi.unstubAllGlobals();
  await Promise.all([first.stop(), second.stop()]);
});

const rejectionOf = (promise: Promise<unknown>): Promise<unknown> =>
  promise.then(
    () => 'it was resolved',
    (error: unknown) => error,
  );

describe('two clients in one process', () => {
  it('each talk to their own server with their own token', async () => {
    const others = new Client({ server: `${second.address}/`, token: 'secret' });
    const jobs = [client.follow(id), others.follow(id)];
    await eventually(() => expect([first.streams.size, second.streams.size]).toEqual([1, 1]));
    second.end();
    expect((await jobs[1])?.volume).toBe('second');
    // The end of the second job ends the second stream alone.
    await eventually(() => expect([first.streams.size, second.streams.size]).toEqual([1, 0]));
    first.end();
    expect((await jobs[0])?.volume).toBe('first');
    expect([...first.tokens]).toEqual([undefined]);
    expect([...second.tokens]).toEqual(['Bearer secret']);
    expect(await rejectionOf(client.getVolume('a'))).toMatchObject({ status: 404, detail: 'first has no /v1/volumes/a' });
    expect(await rejectionOf(others.getVolume('a'))).toMatchObject({ status: 404, detail: 'second has no /v1/volumes/a' });
  });
});

describe('an address of a response', () => {
  it('leads to no other server', async () => {
    const others = new Client({ server: first.address, token: 'secret' });
    const job = await others.getJob(id);
    const here = second.address.replace('http:', '');
    for (const href of [here, here.replaceAll('/', '\\'), `@${here.slice(2)}/mesh.glb`, `.example${here}`, second.address, '']) {
      const moved = { ...job, mesh: { files: { glb: { href } } } } as unknown as Job;
      expect(await rejectionOf(others.meshOf(moved, 'glb')), href).toMatchObject({ status: -1 });
    }
    expect(second.asked).toEqual([]);
  });

  it('leads to no other server from a page that names none', () => {
    const own = new Connection('', 'secret');
    for (const gap of ['', '\t', '\r', '\n', '\r\n\t']) {
      for (const href of [`/${gap}/other.example/mesh.glb`, `/${gap}\\other.example/mesh.glb`]) {
        expect(() => own.addressOf(href), JSON.stringify(href)).toThrow(ApiError);
      }
    }
    expect(() => own.addressOf('/v1/jobs/\n')).toThrow(ApiError);
    expect(own.addressOf('/v1/jobs/a//b c?state=queued')).toBe('/v1/jobs/a//b c?state=queued');
  });

  it('is not followed if it is that of a redirect, which a page is not shown', async () => {
    vi.stubGlobal('fetch', () => Promise.resolve(Object.defineProperty(Response.error(), 'type', { value: 'opaqueredirect' })));
    expect(await rejectionOf(client.getJob(id))).toMatchObject({ status: -1, title: 'The server redirects to another address' });
  });
});

describe('a window of huge values', () => {
  it('is asked for as it is', async () => {
    const window: [number, number] = [-1e30, 1e30];
    for (const asking of [client.slicePicture('a', 'z', 0, window), client.previewFile('a', 9, window)]) {
      await rejectionOf(asking);
      expect(first.query.get('window')?.split(',').map(Number)).toEqual(window);
    }
  });
});

describe('a redirect', () => {
  it('is not followed: neither the token nor the volume goes to another server', async () => {
    first.proxy = (response) => response.writeHead(307, { Location: `${second.address}/v1/volumes` }).end();
    const named = new Client({ server: first.address, token: 'secret' });
    for (const asking of [named.upload(new Uint8Array([1, 2, 3]), { name: 'a.nrrd' }), named.follow(id), named.getVolume('a')]) {
      expect(await rejectionOf(asking)).toMatchObject({ status: -1, title: 'The server redirects to another address' });
    }
    expect(first.tokens).toEqual(new Set(['Bearer secret']));
    expect(second.asked).toEqual([]);
  });
});

describe('the labels of a job', () => {
  it('come from all pages', async () => {
    expect((await client.labelsOfJob(id)).map(({ label }) => label)).toEqual([1, 2, 3]);
    expect(first.asked.length).toBe(2);
  });

  it('have walls, which come from all pages', async () => {
    expect((await client.wallsOfJob(id)).map(({ b }) => b)).toEqual([null, 4]);
    expect((await client.wallsOfJob(id, undefined, { edgeContacts: true })).map(({ b }) => b)).toEqual([null, 4, 5]);
  });
});

describe('a list of another API', () => {
  it.each(['[]', '{"labels":7,"walls":7,"next":null}', '{"labels":null,"walls":null}'])('is an error: %s', async (body) => {
    first.proxy = (response) => void response.end(body);
    for (const list of [client.labelsOf(id, 0), client.labelsOfJob(id), client.wallsOfJob(id)]) {
      expect(await rejectionOf(list)).toMatchObject({ status: -1, title: 'The response is not one of isomeshd' });
    }
  });

  it('ends with a page that names no next one, or has nothing', async () => {
    for (const body of ['{"labels":[{"label":1}]}', '{"labels":[],"next":"more"}']) {
      first.asked.length = 0;
      first.proxy = (response) => void response.end(body);
      await client.labelsOf(id, 0);
      await client.labelsOfJob(id);
      expect(first.asked).toHaveLength(2);
    }
  });
});

describe('the mesh of a job', () => {
  it('is the file of its label if it has only one', async () => {
    const job = await client.getJob(id);
    const files = { stl: { href: `/v1/jobs/${id}/mesh.glb` } };
    const ofLabels = (labels: unknown[]): Job => ({ ...job, mesh: { files: {}, labels } }) as Job;
    expect(Buffer.from(await client.meshOf(ofLabels([{ label: 5, files }]), 'stl')).toString()).toBe('glTF');
    for (const none of [ofLabels([{ label: 5, files }, { label: 6, files }]), job, { ...job, mesh: null } as Job]) {
      expect(await rejectionOf(client.meshOf(none, 'stl'))).toBeInstanceOf(RangeError);
    }
  });

  it('is an error without a surface, unless that is allowed', async () => {
    const files = { stl: { href: `/v1/jobs/${id}/mesh.glb` } };
    const empty = { ...(await client.getJob(id)), mesh: { empty: true, empty_reason: 'it has none', files } } as unknown as Job;
    const error = await rejectionOf(client.meshOf(empty, 'stl'));
    expect(error).toMatchObject({ status: 422, detail: 'The surface is empty: it has none. The option allowEmpty accepts that.' });
    expect(adviceFor(error as ApiError)).toBe('');
    expect(await rejectionOf(client.meshOf(empty, 'glb'))).toMatchObject({ status: 422 });
    expect((await client.meshOf(empty, 'stl', undefined, { allowEmpty: true })).byteLength).toBeGreaterThan(0);
  });
});

describe('the labels of a volume', () => {
  it('come from all pages', async () => {
    const list = await client.labelsOf(id, 0);
    expect(list.labels.map(({ label }) => label)).toEqual([1, 2, 3]);
    expect(list.next).toBe(null);
  });
});

describe('follow', () => {
  it('rejects with a TimeoutError at the time limit, and closes its stream', async () => {
    const limit = new AbortController();
    const rejection = rejectionOf(client.follow(id, limit.signal, () => undefined));
    await eventually(() => expect(first.streams.size).toBe(1));
    limit.abort(new DOMException('', 'TimeoutError')); // as AbortSignal.timeout() does
    const error = await rejection;
    expect(error).toBeInstanceOf(DOMException);
    expect(error).toMatchObject({ name: 'TimeoutError' });
    expect(first.asked).toContain('GET /v1/events');
    await eventually(() => expect(first.streams.size).toBe(0));
  });

  it('rejects with an AbortError while a request waits for its response, and closes that', async () => {
    first.holds = true;
    const over = new AbortController();
    const error = rejectionOf(client.follow(id, over.signal));
    await eventually(() => expect([first.streams.size, first.held.size]).toEqual([1, 1]));
    over.abort();
    expect(await error).toBe(over.signal.reason);
    expect(await error).toMatchObject({ name: 'AbortError' });
    await eventually(() => expect([first.streams.size, first.held.size]).toEqual([0, 0]));
  });

  it('leaves the stream to those that still follow', async () => {
    const over = new AbortController();
    const stopped = rejectionOf(client.follow(id, over.signal));
    const other = client.follow(id);
    await eventually(() => expect(first.streams.size).toBe(1));
    over.abort(new Error('enough'));
    expect(await stopped).toEqual(new Error('enough'));
    first.end();
    expect((await other).state).toBe('succeeded');
    expect(first.asked.filter((each) => each === 'GET /v1/events')).toHaveLength(1);
  });

  it('rejects at once and sends nothing if the signal is aborted already', async () => {
    const signal = AbortSignal.abort();
    expect(await rejectionOf(client.follow(id, signal))).toBe(signal.reason);
    expect(first.asked).toEqual([]);
  });

  it('rejects with what its callback throws', async () => {
    const fault = new TypeError('job.mesh is null');
    const fail = (): never => {
      throw fault;
    };
    expect(await rejectionOf(client.follow(id, undefined, fail))).toBe(fault);
    await eventually(() => expect(first.streams.size).toBe(0));
  });

  it('keeps no listener on a signal that lives longer', async () => {
    const { signal } = new AbortController();
    const add = vi.spyOn(signal, 'addEventListener');
    first.state = 'succeeded';
    await client.follow(id, signal);
    expect(add).toHaveBeenCalledOnce();
    const [, , options] = add.mock.calls[0] ?? [];
    expect((options as AddEventListenerOptions).signal?.aborted).toBe(true);
  });
});

describe('a request', () => {
  it('rejects with the reason of its own signal, which says nothing about the server', async () => {
    first.holds = true;
    const error = await rejectionOf(client.getJob(id, 0, AbortSignal.timeout(100)));
    expect(error).toMatchObject({ name: 'TimeoutError' });
    expect(client.connection.connected.value).toBe(true);
  });

  it('says that no server responded, and why', async () => {
    const { address } = second;
    await second.stop();
    const error = await rejectionOf(new Client({ server: address }).getVolume('a'));
    await second.start();
    expect(error).toBeInstanceOf(ApiError);
    expect(error).toMatchObject({ status: 0, isUnreachable: true, cause: { code: 'ECONNREFUSED' } });
    expect((error as ApiError).detail).toContain(`The server at ${address} did not respond. Check`);
  });

  it('of another page says that the server may not allow it, because the browser does not', async () => {
    const { address } = first;
    const detailOn = async (origin: string, server?: string): Promise<string> => {
      vi.stubGlobal('location', { origin });
      // As browsers do, whether the server is down or does not allow the page.
      vi.stubGlobal('fetch', () => Promise.reject(new TypeError('Failed to fetch')));
      const error = await rejectionOf(new Client({ server }).getVolume('a'));
      vi.unstubAllGlobals();
      expect(error).toMatchObject({ isUnreachable: true });
      return (error as ApiError).detail;
    };
    const foreign = await detailOn('https://viewer.example', address);
    expect(foreign).toContain(`The server at ${address} did not respond, or it does not allow pages of the origin https://viewer.example.`);
    expect(foreign).toContain('isomeshd is running there with --cors-origin https://viewer.example,');
    expect(await detailOn('null', address)).toContain("--cors-origin '*',");
    expect(await detailOn(address, `${address}/`)).not.toContain('--cors-origin');
    expect(await detailOn('https://viewer.example')).not.toContain('--cors-origin');
  });

  it('says so also if the connection breaks within a response', async () => {
    const job = await client.getJob(id);
    for (const status of [200, 404]) {
      first.proxy = (response) => {
        response.writeHead(status, { 'Content-Length': 1000 }).write('{"id":', () => response.destroy());
      };
      for (const ask of [
        () => client.getJob(id),
        () => client.getVolume('a'),
        () => client.slicePicture('a', 'z', 0, [0, 1]),
        () => client.previewFile('a', 9, [0, 1]),
        () => client.meshOf(job, 'glb'),
        () => client.upload(new Uint8Array(9)),
      ]) {
        const error = await rejectionOf(ask());
        expect(error, String(ask)).toBeInstanceOf(ApiError);
        expect(error, String(ask)).toMatchObject({ status: 0 });
        expect(client.connection.connected.value).toBe(false);
      }
    }
  });

  it('tells a page of a proxy from a response of the API', async () => {
    for (const body of ['<html>Log in</html>', '', 'null', '"ok"']) {
      first.proxy = (response) => response.end(body);
      for (const ask of [() => client.getVolume('a'), () => client.upload(new Uint8Array(9))]) {
        const error = await rejectionOf(ask());
        expect(error, body).toBeInstanceOf(ApiError);
        expect(error, body).toMatchObject({ status: 200, detail: expect.stringContaining('not one of isomeshd') as string });
      }
    }
  });

  it('with a token that no header can carry says so, without that token', async () => {
    for (const token of ['sec\nret', 'secret\u20ac']) {
      const guarded = new Client({ server: first.address, token });
      for (const asking of [guarded.getVolume('a'), guarded.follow(id), guarded.submitJob({ volume: 'a', iso: 60 }), guarded.upload(new Uint8Array(9))]) {
        const error = await rejectionOf(asking);
        expect(error).toBeInstanceOf(ApiError);
        expect(error).toMatchObject({ status: -1, title: 'The token cannot be sent' });
        expect((error as ApiError).detail).not.toContain('sec');
      }
    }
    expect(first.asked).toEqual([]);
  });

  it('has its key in Node 18, too, which has no global crypto', async () => {
    vi.stubGlobal('crypto', undefined);
    const keys = new Set<unknown>();
    for (let each = 0; each < 20; each += 1) {
      const job = (await client.submitJob({ volume: 'a', iso: 60 })) as Job & { key: string };
      expect(job.key).toMatch(/^[0-9a-f]{32}$/);
      keys.add(job.key);
    }
    expect(keys.size).toBe(20);
  });
});

describe('upload', () => {
  const bytes = Uint8Array.from([92, 1, 0, 0, 7]);

  it('takes bytes in every form', async () => {
    const forms: Parameters<Client['upload']>[0][] = [
      bytes,
      Buffer.from(bytes),
      bytes.buffer,
      new DataView(bytes.buffer),
      new Blob([bytes]),
      new File([bytes], 'head.nii') as unknown as Blob,
    ];
    for (const form of forms) {
      const told: number[] = [];
      const { volumes } = await client.upload(form, { onProgress: (sent) => told.push(sent) });
      expect(volumes[0]?.volume?.id, form.constructor.name).toBe('first');
      expect([...first.uploaded], form.constructor.name).toEqual([...bytes]);
      expect(told.at(-1), form.constructor.name).toBe(bytes.length);
      first.uploaded = Buffer.alloc(0);
    }
    // The part that a view shows, and not the whole buffer.
    await client.upload(bytes.subarray(1, 3));
    expect([...first.uploaded]).toEqual([1, 0]);
  });

  it('of what the server keeps sends no bytes', async () => {
    for (const whole of [bytes, new Uint8Array(9_000_000)]) {
      const { volumes } = await client.upload(whole, { kept: 'f00d', choices: { volume: '1' }, name: 'head.nii' });
      expect(volumes[0]?.volume?.id).toBe('f00d');
      expect(first.query.get('volume')).toBe('1');
      expect(first.asked.splice(0)).toEqual(['POST /v1/volumes']);
    }
  });

  it('of a file that was changed says so at once, and leaves nothing on the server', async () => {
    // Newer than the types.
    const { openAsBlob } = fs as unknown as { openAsBlob: (path: string) => Promise<Blob> };
    const folder = fs.mkdtempSync(join(tmpdir(), 'isomesh-changed-'));
    try {
      const path = join(folder, 'head.nii');
      fs.writeFileSync(path, bytes);
      const file = await openAsBlob(path);
      fs.appendFileSync(path, 'more');
      const error = await rejectionOf(client.upload(file));
      expect(error).toBeInstanceOf(ApiError);
      expect(error).toMatchObject({ status: -1, title: 'The file cannot be read', cause: { name: 'NotReadableError' } });
      await eventually(() => expect(first.asked.at(-1)).toBe('DELETE /v1/uploads/a'));
    } finally {
      fs.rmSync(folder, { recursive: true });
    }
  });

  it('rejects with what its callback throws', async () => {
    const fault = new TypeError('bar is null');
    const fail = (): never => {
      throw fault;
    };
    expect(await rejectionOf(client.upload(new Uint8Array(9_000_000), { onProgress: fail }))).toBe(fault);
  });

  it('rejects anything else, and names what it takes', async () => {
    const takes = /^upload takes a Blob, a File, an ArrayBuffer or a Uint8Array, not /;
    for (const [form, name] of [
      ['head.nii.gz', 'a string'],
      [new URL('file:///head.nii.gz'), 'URL'],
      [[1, 2], 'Array'],
      [undefined, 'undefined'],
      [null, 'null'],
    ] as const) {
      const error = await rejectionOf(client.upload(form as unknown as Uint8Array));
      expect(error).toBeInstanceOf(TypeError);
      expect((error as Error).message).toMatch(takes);
      expect((error as Error).message).toContain(`not ${name}. `);
      expect((error as Error).message).toContain("upload(await readFile('head.nii.gz'))");
    }
    expect(first.asked).toEqual([]);
  });

  it('sends nothing if its signal is aborted already', async () => {
    const signal = AbortSignal.abort();
    expect(await rejectionOf(client.upload(bytes, { signal }))).toBe(signal.reason);
    expect(first.asked).toEqual([]);
  });
});

describe("a server's address", () => {
  it('is required in Node', () => {
    expect(() => new Client()).toThrow("The client needs the server's address, such as new Client(");
    expect(() => new Client({ token: 'a' })).toThrow(TypeError);
  });

  it('begins with its scheme', () => {
    for (const server of ['127.0.0.1:8080', 'unix:/run/isomesh', 'http://']) {
      expect(() => new Client({ server })).toThrow(`It is "${server}".`);
    }
  });
});
