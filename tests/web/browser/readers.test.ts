// The loaders of three.js read the files in a browser, as their users do.
import { fileURLToPath } from 'node:url';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { ballNrrd, Daemon, labelsNrrd, startBrowser, type JobAnswer } from './support';

interface Found {
  meshes: { name: string; colour: string; triangles: number }[];
  bounds: number[][];
}

const here = (path: string): string => fileURLToPath(new URL(path, import.meta.url));
const origin = 'http://readers.test';
const importMap = {
  imports: { three: '/node_modules/three/build/three.module.js', 'three/addons/': '/node_modules/three/examples/jsm/' },
};
const html = `<script type="importmap">${JSON.stringify(importMap)}</script><script type="module" src="/three_reader.js"></script>`;

// A place in LPS millimetres, in the metres of glTF with Y up.
function inGltf([x = 0, y = 0, z = 0]: number[]): number[] {
  return [x / 1000, z / 1000, -y / 1000];
}

function triangles({ meshes }: Found): number {
  return meshes.reduce((sum, mesh) => sum + mesh.triangles, 0);
}

describe('three.js', () => {
  let daemon: Daemon;
  let browser: Browser;
  let page: Page;
  const files = new Map<string, Buffer>();

  beforeAll(async () => {
    daemon = await Daemon.start();
    browser = await startBrowser();
    page = await browser.newPage();
    await page.route(`${origin}/**`, async (route) => {
      const { pathname } = new URL(route.request().url());
      const file = files.get(pathname);
      if (file) await route.fulfill({ body: file });
      else if (pathname === '/') await route.fulfill({ body: html, contentType: 'text/html' });
      else await route.fulfill({ path: here(pathname.startsWith('/node_modules') ? `../../../client/web${pathname}` : `.${pathname}`) });
    });
    await page.goto(origin);
    await page.waitForFunction('globalThis.read');
  });
  afterAll(async () => {
    await browser?.close();
    await daemon?.remove();
  });

  async function read(job: JobAnswer, format: string): Promise<Found> {
    const answer = await fetch(`${daemon.url}/v1/jobs/${job.id}/mesh.${format}`);
    expect(answer.status).toBe(200);
    const path = `/${job.id}.${format}`;
    files.set(path, Buffer.from(await answer.arrayBuffer()));
    return page.evaluate(`read('${path}')`);
  }

  function expectBounds(found: Found, job: JobAnswer, change = (point: number[]): number[] => point): void {
    const corners = (job.mesh?.bounds ?? []).map(change);
    const wanted = [Math.min, Math.max].map((end) => [0, 1, 2].map((axis) => end(...corners.map((corner) => corner[axis] ?? NaN))));
    const size = Math.max(...[0, 1, 2].map((axis) => (wanted[1]?.[axis] ?? NaN) - (wanted[0]?.[axis] ?? NaN)));
    found.bounds.flat().forEach((value, at) => expect(Math.abs(value - (wanted.flat()[at] ?? NaN))).toBeLessThan(1e-4 * size));
  }

  it('reads a surface in all its formats', async () => {
    const volume = await daemon.upload(ballNrrd(24, 8));
    const formats = ['drc', 'stl', 'ply', 'obj', '3mf'];
    const job = await daemon.make({ volume, iso: 100, formats });
    for (const format of formats) {
      const found = await read(job, format);
      expect(triangles(found), format).toBe(job.mesh?.triangles);
      expectBounds(found, job);
    }
  });

  it.each(['none', 'quantized', 'meshopt', 'khr-meshopt', 'draco'])('reads GLB of labels with the codec %s', async (codec) => {
    const volume = await daemon.upload(labelsNrrd(24));
    const names = { label_names: { 1: 'Liver', 2: 'Left kidney', 5: 'Bone' }, label_colors: { 1: '#cc3311', 2: '#33bbee', 5: '#ee7733' } };
    const job = await daemon.make({ volume, labels: 'all', formats: ['glb'], glb_codec: codec, ...names });
    const found = await read(job, 'glb');
    expect(found.meshes).toEqual([
      { name: 'Liver', colour: 'cc3311', triangles: job.mesh?.labels?.[0]?.triangles },
      { name: 'Left kidney', colour: '33bbee', triangles: job.mesh?.labels?.[1]?.triangles },
      { name: 'Bone', colour: 'ee7733', triangles: job.mesh?.labels?.[2]?.triangles },
    ]);
    expectBounds(found, job, inGltf);
  });

  it('reads 3MF and OBJ of labels', async () => {
    const volume = await daemon.upload(labelsNrrd(24));
    const names = { label_names: { 1: 'Liver', 2: 'Kidney', 5: 'Bone' }, label_colors: { 1: '#cc3311', 2: '#33bbee', 5: '#ee7733' } };
    const job = await daemon.make({ volume, labels: 'all', formats: ['3mf', 'obj'], ...names });
    for (const format of ['3mf', 'obj']) {
      const found = await read(job, format);
      expect(found.meshes.map((mesh) => [mesh.name, mesh.triangles])).toEqual(
        ['Liver', 'Kidney', 'Bone'].map((name, at) => [name, job.mesh?.labels?.[at]?.triangles]),
      );
      if (format === '3mf') expect(found.meshes.map((mesh) => mesh.colour)).toEqual(['cc3311', '33bbee', 'ee7733']);
      expectBounds(found, job);
    }
  });
});
