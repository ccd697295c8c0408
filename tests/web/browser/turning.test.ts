// A surface while it is turned by the pointer, and afterwards.
import { readFileSync } from 'node:fs';
import type { Locator, Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { boxOf, brain, brainHull, openSurface, setup, still } from './support';

const { at, it } = setup();

declare global {
  interface Window {
    // Triangles of each frame.
    drawn: number[];
  }
}

// What a frame draws: all that is drawn in one task.
function countTriangles(page: Page): Promise<void> {
  return page.addInitScript(() => {
    window.drawn = [];
    const made = WebGL2RenderingContext.prototype;
    // eslint-disable-next-line @typescript-eslint/unbound-method -- called on their contexts below
    const { drawElements } = made;
    let triangles = 0;
    made.drawElements = function (mode, count, type, offset) {
      if (triangles === 0) {
        queueMicrotask(() => {
          window.drawn.push(triangles);
          triangles = 0;
        });
      }
      triangles += count / 3;
      drawElements.call(this, mode, count, type, offset);
    };
  });
}

function pixelsOf(canvas: Locator): Promise<number> {
  return canvas.evaluate(({ width, height }: HTMLCanvasElement) => width * height);
}

describe('a large surface', () => {
  it('is turned by a coarse copy with fewer pixels where frames take long, and rests whole', async ({ daemon, page }) => {
    await countTriangles(page);
    const volume = await daemon.upload(readFileSync(brain));
    const { id, mesh } = await daemon.make({ volume, iso: brainHull, formats: ['glb'] });
    await openSurface(at, id);
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
        return page.evaluate(() => window.drawn.filter((triangles) => triangles < 65_000).length);
      }, { interval: 0, timeout: 120_000 })
      .toBeGreaterThan(30);
    expect(await pixelsOf(canvas)).toBeLessThan(pixels);
    await page.evaluate(() => (window.drawn = []));
    await page.mouse.up();
    await still(page);
    expect(await pixelsOf(canvas)).toBe(pixels);
    // In steps.
    expect(await page.evaluate(() => window.drawn.reduce((sum, triangles) => sum + triangles, 0))).toBeGreaterThanOrEqual(all);
  });
});
