// Pictures of each view, of real volumes, for README and docs/page.md. ISOMESH_PICTURES names their folder.
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { gunzipSync } from 'node:zlib';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { encodePng } from './png';
import { contourPixels, pixelsOf, silhouette } from './seen';
import { ballNrrd, brain, brainHull, Daemon, openPage, startBrowser, still, surfaceLoaded } from './support';

const skullProject = '/usr/share/doc/invesalius-examples/examples/Cranium.inv3';
const atlas = '/usr/share/mricron/templates/aal.nii';
const mostBytes = 150_000;

const scratch = mkdtempSync(join(tmpdir(), 'isomesh-pictures-'));
const folder = process.env.ISOMESH_PICTURES ?? scratch;

let browser: Browser;
let daemon: Daemon;

beforeAll(async () => {
  mkdirSync(folder, { recursive: true });
  browser = await startBrowser();
  daemon = await Daemon.start();
});

afterAll(async () => {
  await browser?.close();
  await daemon?.remove();
  rmSync(scratch, { recursive: true, force: true });
});

// The CT of a head in InVesalius' example project: int16, z slowest, its slices from the feet up and
// their rows from the back to the front.
async function uploadHead(): Promise<string> {
  const inside = mkdtempSync(join(scratch, 'head-'));
  execFileSync('tar', ['-xzf', skullProject, '-C', inside, '--strip-components=1', '--wildcards', '*/main.plist', '*/matrix.dat']);
  const plist = readFileSync(join(inside, 'main.plist'), 'utf8');
  const numbers = (key: string): number[] => {
    const array = new RegExp(`<key>${key}</key>\\s*<array>([^]*?)</array>`).exec(plist)?.[1] ?? '';
    return [...array.matchAll(/>([-\d.]+)</g)].map((match) => Number(match[1]));
  };
  const dims = numbers('shape').reverse();
  const query = new URLSearchParams({
    dims: dims.join(','),
    type: 'int16',
    spacing: numbers('spacing').join(','),
    direction: '1,0,0,0,-1,0,0,0,1',
  });
  const { id } = await daemon.json<{ id: string }>(`/v1/volumes?${query.toString()}`, {
    method: 'POST',
    body: new Blob([new Uint8Array(readFileSync(join(inside, 'matrix.dat')))]),
  });
  return id;
}

// Every second sample along each axis of the atlas of mricron-data, which software draws in bearable time,
// and what its labels are called.
async function uploadAtlas(): Promise<{ id: string; names: Record<string, string> }> {
  const file = gunzipSync(readFileSync(`${atlas}.gz`));
  const [x, y, z] = [42, 44, 46].map((at) => file.readInt16LE(at)) as [number, number, number];
  const first = file.readFloatLE(108);
  const dims = [x, y, z].map((count) => Math.floor(count / 2)) as [number, number, number];
  const samples = new Uint8Array(dims[0] * dims[1] * dims[2]);
  for (let i = 0; i < samples.length; i += 1) {
    const [i0, rest] = [i % dims[0], Math.floor(i / dims[0])];
    const [i1, i2] = [rest % dims[1], Math.floor(rest / dims[1])];
    samples[i] = file[first + (2 * i2 * y + 2 * i1) * x + 2 * i0] ?? 0;
  }
  const query = new URLSearchParams({
    dims: dims.join(','),
    type: 'uint8',
    spacing: '2,2,2',
    direction: '-1,0,0,0,-1,0,0,0,1',
  });
  const { id } = await daemon.json<{ id: string }>(`/v1/volumes?${query.toString()}`, {
    method: 'POST',
    body: new Blob([samples]),
  });
  const lines = readFileSync(`${atlas}.txt`, 'latin1').split('\n');
  const named = lines.map((line) => line.trim().split(/\s+/)).filter(([, name]) => name);
  const names: Record<string, string> = {};
  for (const [label = '', name = ''] of named) names[label] = name.replaceAll('_', ' ');
  return { id, names };
}

async function take(page: Page, name: string): Promise<void> {
  const { width, height, text } = await readPng(page, await page.screenshot());
  const bytes = encodePng(width, height, new Uint8Array(Buffer.from(text, 'base64')));
  writeFileSync(join(folder, `${name}.png`), bytes);
  expect(bytes.length, name).toBeLessThan(mostBytes);
  expect(bytes.length, name).toBeGreaterThan(10_000);
}

// A PNG's pixels as text, which is how they come out of the page.
async function readPng(page: Page, picture: Buffer): Promise<{ width: number; height: number; text: string }> {
  const pixels = await pixelsOf(page, picture);
  return pixels.evaluate(({ data, width, height }) => {
    let text = '';
    for (let i = 0; i < data.length; i += 8192) text += String.fromCharCode(...data.subarray(i, i + 8192));
    return { width, height, text: btoa(text) };
  });
}

describe('pictures', () => {
  it('are taken of every view', async () => {
    const body = new Blob([new Uint8Array(readFileSync(brain))]);
    const { id: volume } = await daemon.json<{ id: string }>('/v1/volumes', { method: 'POST', body });
    const skull = await uploadHead();
    const { page, faults } = await openPage(browser, daemon.url, { viewport: { width: 1120, height: 680 } });

    await page.goto(`${daemon.url}/#/volumes/${skull}?iso=250`);
    await expect.poll(() => page.locator('.estimate:not(.stale) dd').count()).toBeGreaterThan(2);
    for (const plane of ['axial', 'coronal', 'sagittal']) {
      await expect.poll(() => contourPixels(page, plane)).toBeGreaterThan(100);
    }
    const live = page.locator('.live');
    await expect.poll(async () => Number(await live.getAttribute('data-size'))).toBeGreaterThan(64);
    await expect.poll(() => live.locator('.live-picture[data-still]').count()).toBe(1);
    await take(page, 'iso-value');

    // A fresh page each, so that no surface of the last one is taken for the next.
    const show = async (place: string, surfaces: number): Promise<void> => {
      await page.goto('about:blank');
      await page.goto(`${daemon.url}/#/${place}`);
      await surfaceLoaded(page, surfaces);
    };
    const bone = await daemon.make({ volume: skull, iso: 250, formats: ['glb'] });
    await show(`jobs/${bone.id}`, 1);
    expect((await silhouette(page, page.locator('.viewport'))).part).toBeGreaterThan(0.1);
    await take(page, 'surface');

    const { id: labelled, names } = await uploadAtlas();
    const labels = await daemon.make({ volume: labelled, labels: 'all', label_names: names, formats: ['glb', 'stl'] });
    await show(`jobs/${labels.id}`, 1);
    const view = await page.locator('.viewport').boundingBox();
    if (!view) throw new Error('there is no viewport');
    await page.mouse.click(view.x + view.width / 2, view.y + 0.55 * view.height);
    await expect.poll(() => page.locator('.picked-label').isVisible()).toBe(true);
    await still(page);
    await take(page, 'labels');

    const cut = await daemon.make({ volume, iso: brainHull, formats: ['glb'] });
    await page.emulateMedia({ colorScheme: 'dark' });
    await show(`jobs/${cut.id}`, 1);
    const slice = page.waitForResponse(/slice\.png/);
    await page.keyboard.press('c');
    await slice;
    await expect.poll(() => page.locator('.viewport[data-slice]').count()).toBe(1);
    await still(page);
    await take(page, 'cut');
    await page.emulateMedia({ colorScheme: 'light' });

    // Small enough for four at once under software rendering.
    const jobs = [];
    for (const scheme of [5, 6]) {
      for (const interpolation of ['linear', 'midpoint']) {
        jobs.push((await daemon.make({ volume, iso: brainHull, scheme, interpolation, formats: ['glb'] })).id);
      }
    }
    await show(`compare?jobs=${jobs.join(',')}`, 4);
    await take(page, 'compare');

    const ball = await daemon.upload(ballNrrd(24, 9));
    const lattices = [];
    for (const scheme of [6, 5, 'bcc']) {
      lattices.push((await daemon.make({ volume: ball, iso: 100, scheme, smoothing: 'optimize', formats: ['glb'] })).id);
    }
    await show(`compare?jobs=${lattices.join(',')}`, 3);
    await page.getByRole('button', { name: 'Flat' }).click();
    await page.getByRole('button', { name: 'Edges' }).click();
    await still(page);
    await take(page, 'lattices');

    await page.goto(daemon.url);
    await expect.poll(() => page.locator('.card').count()).toBe(4);
    await expect.poll(() => page.locator('.thumbnail[data-painted]').count()).toBe(4);
    await take(page, 'volumes');
    expect(faults).toEqual([]);
  }, 400_000);
});
