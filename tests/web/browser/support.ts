// A daemon of the test's own and Chromium in front of it.
import { execFileSync, spawn, type ChildProcess } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { chromium, type Browser, type BrowserContext, type Locator, type Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, beforeEach, expect, test } from 'vitest';

// A head in magnetic resonance and its brain alone, of Debian's mricron-data. The brain's hull has a
// million triangles, which software draws in bearable time.
export const head = '/usr/share/mricron/templates/ch2.nii.gz';
export const brain = '/usr/share/mricron/templates/ch2bet.nii.gz';
export const brainHull = 20;

function fromEnvironment(name: string): string {
  const value = process.env[name];
  if (value === undefined || !existsSync(value)) throw new Error(`${name} has to be the path of a program`);
  return value;
}

export class Daemon {
  private constructor(
    private process: ChildProcess,
    readonly data: string,
    readonly url: string,
  ) {}

  static async start(
    data = mkdtempSync(join(tmpdir(), 'isomesh-web-')),
    listen = '127.0.0.1:0',
    more: string[] = [],
  ): Promise<Daemon> {
    const options = ['--listen', listen, '--data', data, '--log-level', 'error', ...more];
    const child = spawn(fromEnvironment('ISOMESHD'), options, { stdio: ['ignore', 'pipe', 'inherit'] });
    const line = await new Promise<string>((resolve, reject) => {
      createInterface({ input: child.stdout }).once('line', resolve);
      child.once('error', reject);
      child.once('exit', (status) => reject(new Error(`the daemon ended with ${status}`)));
    });
    return new Daemon(child, data, line.replace('listening on ', ''));
  }

  // Ends it at once, as a failing machine would; its data stay.
  async kill(): Promise<void> {
    if (this.process.exitCode !== null || this.process.signalCode !== null) return;
    const ended = new Promise((resolve) => this.process.once('exit', resolve));
    this.process.kill('SIGKILL');
    await ended;
  }

  // At its address, with its data.
  async restart(): Promise<void> {
    this.process = (await Daemon.start(this.data, new URL(this.url).host)).process;
  }

  async remove(): Promise<void> {
    await this.kill();
    rmSync(this.data, { recursive: true, force: true });
  }

  async json<T>(path: string, init?: RequestInit): Promise<T> {
    const isJson = typeof init?.body === 'string';
    const headers = isJson ? { 'Content-Type': 'application/json' } : undefined;
    const answer = await fetch(this.url + path, { headers, ...init });
    if (!answer.ok) throw new Error(`${path}: ${answer.status} ${await answer.text()}`);
    return (await answer.json()) as T;
  }

  async upload(bytes: Buffer): Promise<string> {
    const body = new Blob([new Uint8Array(bytes)]);
    return (await this.json<{ id: string }>('/v1/volumes', { method: 'POST', body })).id;
  }

  submit(parameters: Record<string, unknown>): Promise<JobAnswer> {
    return this.json('/v1/jobs', { method: 'POST', body: JSON.stringify(parameters) });
  }

  // The job when it has ended.
  async make(parameters: Record<string, unknown>): Promise<JobAnswer> {
    let job = await this.submit(parameters);
    while (job.state === 'queued' || job.state === 'running') job = await this.json(`/v1/jobs/${job.id}?wait=30`);
    return job;
  }
}

// A new token, whose hash is in that file then.
export function makeToken(file: string): string {
  return execFileSync(fromEnvironment('ISOMESHD'), ['token', 'add', 'page', '--into', file]).toString().trim();
}

// Runs it with a daemon that wants a token, and one that it takes.
export async function withTokens(run: (guarded: Daemon, token: string) => Promise<void>): Promise<void> {
  const folder = mkdtempSync(join(tmpdir(), 'isomesh-tokens-'));
  const file = join(folder, 'tokens');
  const token = makeToken(file);
  const guarded = await Daemon.start(undefined, '127.0.0.1:0', ['--tokens', file]);
  try {
    await run(guarded, token);
  } finally {
    await guarded.remove();
    rmSync(folder, { recursive: true });
  }
}

export interface JobAnswer {
  id: string;
  state: string;
  parameters: Record<string, unknown>;
  mesh: {
    triangles: number;
    components: number;
    bounds: [[number, number, number], [number, number, number]];
    certificate?: { found_mm: number; proven: boolean; from_mesh: { max_mm: number } };
    files: Record<string, { bytes: number; sha256: string }>;
    labels?: { label: number; triangles: number; volume_mm3: number; area_mm2: number }[];
  } | null;
}

export function startBrowser(): Promise<Browser> {
  return chromium.launch({
    executablePath: fromEnvironment('CHROMIUM'),
    args: [
      '--no-sandbox',
      ...['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
      '--disable-quic',
      '--no-first-run',
      '--disable-background-networking',
      '--disable-component-update',
      '--disable-sync',
    ],
  });
}

export const slowest = 90_000;

// Tells in `window.timers` which of the page's timers are to run within a second.
function noteTimers(page: Page): Promise<void> {
  return page.addInitScript(() => {
    const [set, clear] = [window.setTimeout.bind(window), window.clearTimeout.bind(window)];
    const timers = new Set<number>();
    const setTimeout = (run: (...given: unknown[]) => void, time = 0, ...given: unknown[]): number => {
      const timer = set(() => {
        timers.delete(timer);
        run(...given);
      }, time);
      if (time < 1000) timers.add(timer);
      return timer;
    };
    const clearTimeout = (timer: number): void => {
      timers.delete(timer);
      clear(timer);
    };
    Object.assign(window, { timers, setTimeout, clearTimeout });
  });
}

export interface OpenPage {
  page: Page;
  // Faults that no test provokes: exceptions, what the content policy blocked, foreign hosts.
  faults: string[];
}

export async function openPage(
  browser: Browser | BrowserContext,
  origin: string,
  options: Parameters<Browser['newPage']>[0] = {},
): Promise<OpenPage> {
  const page = await browser.newPage({ viewport: { width: 1180, height: 760 }, ...options });
  await noteTimers(page);
  // A machine with other things to do may take long; what never comes still fails.
  page.setDefaultTimeout(slowest);
  page.setDefaultNavigationTimeout(slowest);
  const faults: string[] = [];
  page.on('pageerror', (error) => faults.push(String(error)));
  page.on('console', (message) => {
    if (/Content.Security.Policy|Refused to/i.test(message.text())) faults.push(message.text());
  });
  page.on('request', (request) => {
    const url = request.url();
    if (![origin, 'blob:', 'about:'].some((start) => url.startsWith(start))) faults.push(`asked for ${url}`);
  });
  return { page, faults };
}

export interface Setup extends OpenPage {
  browser: Browser;
  daemon: Daemon;
}

type It = (name: string, run: (at: Setup) => Promise<void>, more?: string[]) => void;

// A browser and a daemon for the tests of a file, with a fresh page for each of them, that may have no
// faults. `it` gives them to a test, `alone` gives it a daemon of its own, which may have more options; `at` is to be taken
// apart inside of one.
export function setup(options: Parameters<Browser['newPage']>[0] = {}): { at: Setup; it: It; alone: It } {
  const made = {} as Setup;
  beforeAll(async () => {
    made.browser = await startBrowser();
    made.daemon = await Daemon.start();
  });
  afterAll(async () => {
    await made.browser?.close();
    await made.daemon?.remove();
  });
  beforeEach(async () => {
    Object.assign(made, await openPage(made.browser, made.daemon.url, options));
  });
  afterEach(async () => {
    await made.page.close();
    expect(made.faults).toEqual([]);
  });
  const runAlone = async (run: (at: Setup) => Promise<void>, more: string[]): Promise<void> => {
    const daemon = await Daemon.start(undefined, undefined, more);
    try {
      const { page, faults } = await openPage(made.browser, daemon.url, options);
      await run({ ...made, daemon, page, faults });
      await page.close();
      expect(faults).toEqual([]);
    } finally {
      await daemon.remove();
    }
  };
  return {
    at: made,
    it: (name, run) => test(name, () => run(made)),
    alone: (name, run, more = []) => test(name, () => runAlone(run, more)),
  };
}

// The job whose page is open.
export function openedJob({ page, daemon }: Setup): Promise<JobAnswer> {
  const id = /#\/jobs\/([^?]+)/.exec(page.url())?.[1] ?? '';
  return daemon.json(`/v1/jobs/${id}`);
}

// That job, once it has succeeded. The page shows the surface of before until then, and its state.
export async function madeJob(at: Setup): Promise<JobAnswer> {
  await expect.poll(async () => (await openedJob(at)).state).toBe('succeeded');
  return openedJob(at);
}

// How far apart two points of a ball are that are seen left and right of its middle, each at that part of
// the radius of its disc, by a camera at that distance.
export function chordOfBall(radius: number, distance: number, part: number): number {
  const slope = (part * radius) / Math.sqrt(distance ** 2 - radius ** 2);
  const lengthening = 1 + slope ** 2;
  const depth = (distance - Math.sqrt(radius ** 2 * lengthening - (slope * distance) ** 2)) / lengthening;
  return 2 * slope * depth;
}

// A cube of samples of those values, as NRRD.
export function cubeNrrd(size: number, value: (x: number, y: number, z: number) => number, fields: string[] = []): Buffer {
  const samples = Buffer.alloc(size ** 3);
  for (let at = 0; at < samples.length; at += 1) {
    samples[at] = value(at % size, Math.floor(at / size) % size, Math.floor(at / size ** 2));
  }
  return Buffer.concat([Buffer.from(nrrdHeader(size, fields)), samples]);
}

// The sample at that depth below a surface at 100.
function sampleAt(depth: number): number {
  return Math.max(0, Math.min(255, 100 + 8 * depth));
}

// A ball of that radius: 100 on its surface, more inside. The first sample tells it from others like it.
export function ballNrrd(size: number, radius: number, seed = 0): Buffer {
  const middle = (size - 1) / 2;
  return cubeNrrd(size, (x, y, z) => (x + y + z === 0 ? seed : sampleAt(radius - Math.hypot(x - middle, y - middle, z - middle))));
}

// A ball and a smaller one on its left side, which do not touch.
export function ballsNrrd(size: number): Buffer {
  const middle = (size - 1) / 2;
  return cubeNrrd(size, (x, y, z) => {
    const inside = ([centre, radius]: readonly [number, number]): number =>
      radius * size - Math.hypot(x - centre * size, y - middle, z - middle);
    return sampleAt(Math.max(inside([0.3, 0.2]), inside([0.78, 0.12])));
  });
}

// A ball cut into two labels, 1 towards the patient's right and 2 towards the left, and a block of label 5
// above it.
export function labelsNrrd(size: number, fields: string[] = []): Buffer {
  const middle = (size - 1) / 2;
  const value = (x: number, y: number, z: number): number => {
    const isInBall = Math.hypot(x - middle, y - middle, z - middle + 2) < size / 3;
    const isInBlock = z >= size - 4 && z < size - 2 && Math.abs(x - middle) < 5 && Math.abs(y - middle) < 5;
    return isInBall ? (x < middle ? 1 : 2) : isInBlock ? 5 : 0;
  };
  return cubeNrrd(size, value, fields);
}

// Noise, whose surface takes long to smooth.
export function noiseNrrd(size: number): Buffer {
  let state = 1;
  return cubeNrrd(size, () => {
    state = (Math.imul(state, 1_103_515_245) + 12_345) >>> 0;
    return state >>> 24;
  });
}

// What the address says of that.
export function noted(page: Page, name: string): string {
  return new URLSearchParams(new URL(page.url()).hash.split('?')[1] ?? '').get(name) ?? '';
}

export function nrrdHeader(size: number, fields: string[] = []): string {
  return [
    'NRRD0004',
    'type: uint8',
    'dimension: 3',
    'space: left-posterior-superior',
    `sizes: ${size} ${size} ${size}`,
    'space directions: (1,0,0) (0,1,0) (0,0,1)',
    'space origin: (0,0,0)',
    'encoding: raw',
    ...fields,
    '',
    '',
  ].join('\n');
}

// As if files were dropped from the system, on that element.
export async function drop(page: Page, files: { name: string; bytes: Buffer }[], on = '.drop'): Promise<void> {
  const transfer = await page.evaluateHandle((given) => {
    const made = new DataTransfer();
    for (const { name, text } of given) {
      made.items.add(new File([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], name));
    }
    return made;
  }, files.map(({ name, bytes }) => ({ name, text: bytes.toString('base64') })));
  await page.dispatchEvent(on, 'drop', { dataTransfer: transfer });
}

// The first half of each mesh comes, and the rest when it is released.
export async function holdMeshes(page: Page): Promise<() => void> {
  let release = (): void => undefined;
  const released = new Promise<void>((resolve) => (release = resolve));
  await page.route(/mesh\.glb/, async (route) => {
    const isRest = /bytes=[1-9]/.test(route.request().headers().range ?? '');
    if (isRest) await released;
    const answer = await route.fetch();
    const whole = await answer.body();
    const body = isRest ? whole : whole.subarray(0, Math.floor(whole.length / 2));
    await route.fulfill({ response: answer, body, headers: { ...answer.headers(), 'content-length': String(body.length) } });
  });
  return release;
}

// Short notices stay. They are gone after six seconds otherwise, in which a busy machine may stand still.
export function keepNotices(page: Page): Promise<void> {
  return page.addInitScript(() => {
    const original = window.setTimeout.bind(window);
    Object.assign(window, { setTimeout: (run: TimerHandler, time?: number) => original(run, time === 6000 ? 600_000 : time) });
  });
}

// Waits until all parts of the surfaces are there and drawn.
export async function surfaceLoaded(page: Page, count = 1): Promise<void> {
  await expect.poll(() => page.locator('.pane[data-loaded]').count(), { timeout: 2 * slowest }).toBe(count);
  await still(page);
}

// The surface of that job, whose address may go on with a query.
export async function openSurface({ page, daemon }: Setup, job: string): Promise<void> {
  await page.goto(`${daemon.url}/#/jobs/${job}`);
  await surfaceLoaded(page);
}

// The place of an element that is shown.
export async function boxOf(element: Locator): Promise<{ x: number; y: number; width: number; height: number }> {
  const box = await element.boundingBox();
  if (!box) throw new Error('the element is not shown');
  return box;
}

export async function drag(page: Page, from: readonly [number, number], to: readonly [number, number], steps = 4): Promise<void> {
  await page.mouse.move(...from);
  await page.mouse.down();
  await page.mouse.move(...to, { steps });
  await page.mouse.up();
}

// Measures between two points so far left and right of the middle of the view, and gives what its label says.
export async function measured(page: Page, reach: number): Promise<string> {
  await page.keyboard.press('m');
  const { x, y, width, height } = await boxOf(page.locator('.viewport'));
  for (const side of [-reach, reach]) await page.mouse.click(x + width / 2 + side, y + height / 2);
  const label = page.locator('.ruler-labels span');
  await expect.poll(() => label.count()).toBe(1);
  return label.innerText();
}

// Waits until the surfaces are drawn as they are to be seen.
export async function still(page: Page): Promise<void> {
  await expect.poll(() => page.locator('.viewport:not([data-still])').count(), { timeout: slowest }).toBe(0);
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
}

// Waits for so long by the page's own timers: all that were set before, and are shorter, have run then.
export function pause(page: Page, milliseconds: number): Promise<void> {
  return page.evaluate((time) => new Promise((resolve) => setTimeout(resolve, time)), milliseconds);
}

// Waits until surfaces rest and no timer of less than a second is left: the page has noted then what it was at.
async function quiet(page: Page): Promise<void> {
  await still(page);
  await expect.poll(() => page.evaluate(() => (window as unknown as { timers: Set<number> }).timers.size)).toBe(0);
}

// The value that no longer changes.
export async function settled<T>(page: Page, read: () => T | Promise<T>): Promise<T> {
  const seen: T[] = [];
  await expect
    .poll(async () => {
      await quiet(page);
      seen.push(await read());
      return seen.length > 1 && seen.at(-1) === seen.at(-2);
    })
    .toBe(true);
  return seen.at(-1) as T;
}
