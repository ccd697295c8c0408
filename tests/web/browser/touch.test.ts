// The page under fingers, as on a tablet.
import type { CDPSession, Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { contourPixels, silhouette } from './seen';
import { ballNrrd, boxOf, noted, openSurface, settled, setup, still } from './support';

const { at, it } = setup({ viewport: { width: 820, height: 1180 }, hasTouch: true, isMobile: true });

interface Point {
  x: number;
  y: number;
}

const steps = 8;

// Fingers that go down together, move along straight lines, and are lifted together.
async function fingers(page: Page, ways: { from: Point; to: Point }[]): Promise<void> {
  const session: CDPSession = await page.context().newCDPSession(page);
  const points = (part: number): { x: number; y: number; id: number }[] =>
    ways.map(({ from, to }, id) => ({
      x: from.x + part * (to.x - from.x),
      y: from.y + part * (to.y - from.y),
      id,
    }));
  await session.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: points(0) });
  for (let step = 1; step <= steps; step += 1) {
    await session.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: points(step / steps) });
  }
  await session.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
  await session.detach();
}

async function middleOf(page: Page, selector: string): Promise<Point & { width: number; height: number }> {
  const box = await boxOf(page.locator(selector));
  return { x: box.x + box.width / 2, y: box.y + box.height / 2, width: box.width, height: box.height };
}

// Where the camera stands around its target, and what it looks at.
async function camera(page: Page): Promise<{ offset: number[]; target: number[]; distance: number }> {
  const numbers = (await settled(page, () => noted(page, 'cam'))).split(',').map(Number);
  const offset = numbers.slice(0, 3);
  return { offset, target: numbers.slice(3), distance: Math.hypot(...offset) };
}

describe('fingers', () => {
  it('turn, move and zoom a surface, and measure it', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await openSurface(at, id);
    await page.getByRole('button', { name: /^Anterior/ }).tap();
    await still(page);
    const { x, y } = await middleOf(page, '.viewport');
    const front = await camera(page);

    // One finger: the camera goes around, the target and the distance stay.
    await fingers(page, [{ from: { x, y }, to: { x: x + 160, y } }]);
    await expect.poll(() => noted(page, 'cam')).not.toBe(front.offset.concat(front.target).join(','));
    const around = await camera(page);
    expect(Math.abs(around.offset[0] ?? 0)).toBeGreaterThan(0.3 * around.distance);
    expect(around.distance / front.distance).toBeCloseTo(1, 2);
    expect(around.target).toEqual(front.target);
    // The page under it stays where it is.
    expect(await page.evaluate(() => document.querySelector('main')?.scrollTop)).toBe(0);

    // Two that part: nearer.
    await fingers(page, [
      { from: { x: x - 40, y }, to: { x: x - 120, y } },
      { from: { x: x + 40, y }, to: { x: x + 120, y } },
    ]);
    const near = await camera(page);
    expect(near.distance).toBeLessThan(0.8 * around.distance);

    // Two side by side: the target moves, the distance stays.
    await fingers(page, [
      { from: { x: x - 40, y }, to: { x: x - 40, y: y + 120 } },
      { from: { x: x + 40, y }, to: { x: x + 40, y: y + 120 } },
    ]);
    const moved = await camera(page);
    expect(moved.distance / near.distance).toBeCloseTo(1, 1);
    expect((moved.target[2] ?? 0) - (near.target[2] ?? 0)).toBeGreaterThan(2);

    // Taps set points; two fingers at once set none.
    await page.getByRole('button', { name: 'Fit' }).tap();
    await still(page);
    const disc = await silhouette(page, page.locator('.viewport'));
    await page.getByRole('button', { name: 'Measure' }).tap();
    await fingers(page, [
      { from: { x: x - 40, y }, to: { x: x - 40, y } },
      { from: { x: x + 40, y }, to: { x: x + 40, y } },
    ]);
    const { height } = await middleOf(page, '.viewport');
    const radius = (disc.height * height) / 2;
    await page.touchscreen.tap(x - 0.8 * radius, y);
    await page.touchscreen.tap(x + 0.8 * radius, y);
    await expect.poll(() => page.locator('.ruler-labels span').count()).toBe(1);
  });

  it('drag the line in the histogram, the window of a slice, and its place', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
    await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(50);

    const line = await middleOf(page, '.histogram');
    const left = line.x - line.width / 2;
    await fingers(page, [
      { from: { x: line.x, y: line.y }, to: { x: left + 0.75 * line.width, y: line.y + 20 } },
    ]);
    const iso = Number(await settled(page, () => noted(page, 'iso')));
    expect(iso).toBeGreaterThan(100);
    await expect.poll(() => page.locator('.iso-input').inputValue()).toBe(String(iso));

    const slice = await middleOf(page, '[data-plane=axial] canvas');
    const width = async (): Promise<number> => {
      const [low, high] = (await settled(page, () => noted(page, 'window'))).split(',').map(Number);
      return (high ?? 0) - (low ?? 0);
    };
    const before = await width();
    await fingers(page, [{ from: slice, to: { x: slice.x + 120, y: slice.y } }]);
    const wide = await width();
    expect(wide).toBeGreaterThan(1.2 * before);
    // A pinch is no drag.
    await fingers(page, [
      { from: { x: slice.x - 20, y: slice.y }, to: { x: slice.x - 90, y: slice.y } },
      { from: { x: slice.x + 20, y: slice.y }, to: { x: slice.x + 90, y: slice.y } },
    ]);
    expect(await width()).toBeCloseTo(wide, 3);

    const place = noted(page, 'at');
    await page.touchscreen.tap(slice.x + 30, slice.y + 30);
    await expect.poll(() => noted(page, 'at')).not.toBe(place);
    expect(await page.evaluate(() => document.querySelector('main')?.scrollTop)).toBe(0);

    // Beside slices and histogram a finger scrolls to what is below.
    await fingers(page, [{ from: { x: 400, y: 840 }, to: { x: 400, y: 500 } }]);
    await expect.poll(() => page.evaluate(() => document.querySelector('main')?.scrollTop)).toBeGreaterThan(0);
  });
});
