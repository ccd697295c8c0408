// How a surface comes: its progress, and what can be done with it meanwhile.
import type { Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { ballNrrd, holdMeshes, keepNotices, labelsNrrd, openSurface, setup, surfaceLoaded } from './support';

const { at, it } = setup();

// Place and distance in millimetres.
type Vertex = readonly [x: number, y: number, z: number, distance: number];

declare global {
  interface Window {
    // What the page said about the loading, one text after the other.
    said: string[];
    // All that workers have decoded.
    vertices: Vertex[];
    triangles: number;
  }
}

function listen(page: Page): Promise<void> {
  return page.addInitScript(() => {
    window.said = [];
    new MutationObserver(() => {
      const text = document.querySelector('.load-status')?.textContent ?? '';
      if (text !== '' && text !== window.said.at(-1)) window.said.push(text);
    }).observe(document, { subtree: true, childList: true, characterData: true });
  });
}

// Keeps the blocks that workers hand to the page.
function keepBlocks(page: Page): Promise<void> {
  return page.addInitScript(() => {
    window.vertices = [];
    window.triangles = 0;
    const keep = ({ data }: MessageEvent<{ blocks?: { positions: Float32Array; index: Uint16Array; distances?: Float32Array }[] } | null>): void => {
      for (const { positions, index, distances } of data?.blocks ?? []) {
        window.triangles += index.length / 3;
        for (let v = 0; 3 * v < positions.length; v += 1) {
          const [x = NaN, y = NaN, z = NaN] = positions.subarray(3 * v, 3 * v + 3);
          window.vertices.push([x, y, z, distances?.[v] ?? NaN]);
        }
      }
    };
    window.Worker = class extends Worker {
      constructor(...given: ConstructorParameters<typeof Worker>) {
        super(...given);
        this.addEventListener('message', keep);
      }
    };
  });
}

// The largest way from a vertex to the nearest of the others, and the largest difference of their distances.
function gaps(from: readonly Vertex[], to: readonly Vertex[]): { way: number; difference: number } {
  const found = { way: 0, difference: 0 };
  for (const [x, y, z, distance] of from) {
    let way = Infinity;
    let nearest = NaN;
    for (const [otherX, otherY, otherZ, other] of to) {
      const between = Math.hypot(x - otherX, y - otherY, z - otherZ);
      if (between >= way) continue;
      way = between;
      nearest = other;
    }
    found.way = Math.max(found.way, way);
    found.difference = Math.max(found.difference, Math.abs(distance - nearest));
  }
  return found;
}

describe('a surface that is loading', () => {
  it('counts the triangles that are drawn, up to all that there are', async ({ page, daemon }) => {
    await listen(page);
    const volume = await daemon.upload(labelsNrrd(24));
    const { id, mesh } = await daemon.make({ volume, labels: 'all', formats: ['glb'] });
    await openSurface(at, id);
    const counts = (await page.evaluate(() => window.said))
      .map((text) => /^(.+) of (.+) triangles\b/.exec(text.replaceAll('\u202f', '')))
      .map((match) => [Number(match?.[1] ?? 0), Number(match?.[2] ?? 0)] as const);
    // Two labels share a wall, so that there are more than the mesh has.
    const all = (mesh?.labels ?? []).reduce((sum, { triangles }) => sum + triangles, 0);
    expect(all).toBeGreaterThan(mesh?.triangles ?? Infinity);
    expect(counts.at(-1)).toEqual([all, all]);
    for (const [drawn, total] of counts) expect(drawn).toBeLessThanOrEqual(total);
  });

  it('counts the triangles of a file that is not compressed, with levels of detail', async ({ page, daemon }) => {
    await listen(page);
    const volume = await daemon.upload(labelsNrrd(24));
    const job = { volume, labels: 'all', formats: ['glb'], glb_codec: 'none', distances: true, lods: [1, 0.3] };
    const { id, mesh } = await daemon.make(job);
    await openSurface(at, id);
    const all = (mesh?.labels ?? []).reduce((sum, { triangles }) => sum + triangles, 0);
    const last = (await page.evaluate(() => window.said)).at(-1)?.replaceAll('\u202f', '');
    expect(last).toBe(`${all} of ${all} triangles (walls between two labels count twice)`);
  });

  it('has the same places and distances if its file is not compressed', async ({ page, daemon }) => {
    await keepBlocks(page);
    const volume = await daemon.upload(labelsNrrd(24));
    const job = { volume, labels: 'all', formats: ['glb'], distances: true };
    const decoded = async (more: object): Promise<{ vertices: Vertex[]; bounds: number[][] }> => {
      const { id, mesh } = await daemon.make({ ...job, ...more });
      await page.goto('about:blank');
      await openSurface(at, id);
      const all = (mesh?.labels ?? []).reduce((sum, { triangles }) => sum + triangles, 0);
      expect(await page.evaluate(() => window.triangles)).toBe(all);
      return { vertices: await page.evaluate(() => window.vertices), bounds: mesh?.bounds ?? [] };
    };
    const { vertices, bounds } = await decoded({ glb_codec: 'none' });
    for (const axis of [0, 1, 2] as const) {
      const values = vertices.map((vertex) => vertex[axis]);
      expect(Math.min(...values)).toBeCloseTo(bounds[0]?.[axis] ?? NaN, 4);
      expect(Math.max(...values)).toBeCloseTo(bounds[1]?.[axis] ?? NaN, 4);
    }
    const most = Math.max(...vertices.map(([, , , distance]) => distance));
    expect(most).toBeGreaterThan(0.01);
    // Draco rounds places to a grid, and distances to a four thousandth of the largest.
    const draco = await decoded({ glb_codec: 'draco', draco: { position_bits: 20 } });
    for (const found of [gaps(vertices, draco.vertices), gaps(draco.vertices, vertices)]) {
      expect(found.way).toBeLessThan(1e-4);
      expect(found.difference).toBeLessThan(most / 4000);
    }
  });

  it('says which files the page shows if the job has none of them', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(24, 8));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'], glb_codec: 'quantized' });
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    const overlay = page.locator('.overlay.message');
    await expect.poll(() => overlay.innerText()).toContain('This job has GLB with the codec quantized only.');
    await overlay.getByRole('link', { name: 'Change parameters' }).click();
    await page.waitForURL(/#\/volumes\//);
    await page.locator('.parameters summary').click();
    const codec = page.locator('[data-parameter=glb_codec]');
    await expect.poll(() => codec.innerText()).toContain('The page cannot show GLB with the codec quantized.');
    await codec.getByRole('radio', { name: 'None' }).check({ force: true });
    await expect.poll(() => codec.innerText()).not.toContain('cannot show');
  });

  it('says so where it is measured', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await keepNotices(page);
    const release = await holdMeshes(page);
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await page.getByRole('button', { name: 'Measure' }).click();
    const canvas = page.locator('.viewport canvas');
    await canvas.click();
    await expect.poll(() => page.locator('.toasts').textContent()).toContain('still loading');
    release();
    await surfaceLoaded(page);
    await canvas.click();
    await expect.poll(() => page.locator('.pane [aria-live]').first().textContent()).toBe('First point set');
  });
});
