// A surface while it is turned by the pointer, and afterwards.
import { readFileSync } from 'node:fs';
import type { Locator, Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { boxOf, brain, brainHull, openSurface, setup, still } from './support';

const { at, it } = setup();

declare global {
  interface Window {
    // Triangles and edges of each frame.
    drawn: { triangles: number; edges: number }[];
    // Triangles of the finest coarse copy, and how many of its edges have another number of them than two.
    copy: { triangles: number; open: number };
  }
}

// What a frame draws: all that is drawn in one task.
function countDrawn(page: Page): Promise<void> {
  return page.addInitScript(() => {
    window.drawn = [];
    const made = WebGL2RenderingContext.prototype;
    // eslint-disable-next-line @typescript-eslint/unbound-method -- called on their contexts below
    const { drawElements } = made;
    let frame: { triangles: number; edges: number } | null = null;
    made.drawElements = function (mode, count, type, offset) {
      if (!frame) {
        frame = { triangles: 0, edges: 0 };
        window.drawn.push(frame);
        queueMicrotask(() => (frame = null));
      }
      if (mode === WebGL2RenderingContext.LINES) frame.edges += count / 2;
      else frame.triangles += count / 3;
      drawElements.call(this, mode, count, type, offset);
    };
  });
}

// Looks at the copies that the worker makes.
function keepCopy(page: Page): Promise<void> {
  return page.addInitScript(() => {
    const look = ({ data }: MessageEvent<{ positions: Float32Array; index: Uint32Array }[][] | null>): void => {
      const surface = data?.[0]?.[0];
      if (!surface) return;
      const { positions, index } = surface;
      const placeOf = (corner: number): string => positions.subarray(3 * (index[corner] ?? 0), 3 * (index[corner] ?? 0) + 3).join();
      const sides = new Map<string, number>();
      for (let i = 0; i < index.length; i += 1) {
        const edge = [placeOf(i), placeOf(i % 3 === 2 ? i - 2 : i + 1)].sort().join(' ');
        sides.set(edge, (sides.get(edge) ?? 0) + 1);
      }
      window.copy = { triangles: index.length / 3, open: [...sides.values()].filter((count) => count % 2 === 1).length };
    };
    window.Worker = class extends Worker {
      constructor(...given: ConstructorParameters<typeof Worker>) {
        super(...given);
        this.addEventListener('message', look);
      }
    };
  });
}

function pixelsOf(canvas: Locator): Promise<number> {
  return canvas.evaluate(({ width, height }: HTMLCanvasElement) => width * height);
}

describe('a large surface', () => {
  it('is turned by a sound coarse copy with its own edges and fewer pixels where frames take long, and rests whole', async ({ daemon, page }) => {
    await countDrawn(page);
    await keepCopy(page);
    const volume = await daemon.upload(readFileSync(brain));
    const { id, mesh } = await daemon.make({ volume, iso: brainHull, formats: ['glb'], close: true });
    await openSurface(at, `${id}?style=wires`);
    const all = mesh?.triangles ?? Infinity;
    const canvas = page.locator('.viewport canvas');
    const pixels = await pixelsOf(canvas);
    const box = await boxOf(canvas);
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.evaluate(() => (window.drawn = []));
    // Until so many frames of the copy were drawn, however long a busy machine takes for them.
    let moves = 0;
    await expect
      .poll(async () => {
        moves += 1;
        await page.mouse.move(x + 100 * Math.sin(moves / 5), y + 30 * Math.cos(moves / 5));
        return page.evaluate(() => window.drawn.filter(({ triangles }) => triangles < 65_000).length);
      }, { interval: 0, timeout: 120_000 })
      .toBeGreaterThan(30);
    expect(await pixelsOf(canvas)).toBeLessThan(pixels);
    // A closed surface has three edges for two triangles. The cube of directions has some triangles, too.
    const last = (await page.evaluate(() => window.drawn.filter(({ triangles }) => triangles < 65_000))).at(-1);
    expect(last?.edges).toBeGreaterThan(1.4 * (last?.triangles ?? Infinity));
    expect(last?.edges).toBeLessThan(1.6 * (last?.triangles ?? 0));
    const copy = await page.evaluate(() => window.copy);
    expect(copy.triangles).toBeGreaterThan(20_000);
    expect(copy.open).toBe(0);
    await page.evaluate(() => (window.drawn = []));
    await page.mouse.up();
    await still(page);
    expect(await pixelsOf(canvas)).toBe(pixels);
    // In steps.
    expect(await page.evaluate(() => window.drawn.reduce((sum, { triangles }) => sum + triangles, 0))).toBeGreaterThanOrEqual(all);
  });
});
