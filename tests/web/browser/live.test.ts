// The surface beside the slices, which follows the iso-value.
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { contourPixels, silhouette } from './seen';
import { ballNrrd, boxOf, drag, labelsNrrd, noted, settled, setup } from './support';

const { at, it } = setup();
let ball: string;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(80, 30));
});

async function open(page: Page, query: string): Promise<void> {
  await page.goto('about:blank');
  await page.goto(`${at.daemon.url}/#/volumes/${ball}?${query}`);
  await rested(page);
}

// Waits until it is drawn as it is to be seen.
async function rested(page: Page): Promise<void> {
  await expect.poll(() => page.locator('.live[data-size="80"] .live-picture[data-still]').count()).toBe(1);
}

// The disc's area, in parts of the cell.
async function area(page: Page): Promise<number> {
  return (await silhouette(page, page.locator('.live-picture'))).part;
}

// That were drawn until now.
function pictures(page: Page): Promise<number> {
  return page
    .locator('.live')
    .evaluate(({ dataset: { moving = 0, resting = 0 } }) => Number(moving) + Number(resting));
}

describe('the surface beside the slices', () => {
  it('is there before a job is made, and follows the line in the histogram', async ({ page }) => {
    const asked: string[] = [];
    await open(page, 'iso=60');
    const large = await area(page);
    expect(large).toBeGreaterThan(0.05);
    page.on('request', (request) => asked.push(new URL(request.url()).pathname));
    const line = await boxOf(page.locator('.histogram'));
    await page.mouse.move(line.x + 0.3 * line.width, line.y + 30);
    await page.mouse.down();
    for (let step = 1; step <= 20; step += 1) {
      const before = await pictures(page);
      await page.mouse.move(line.x + (0.3 + 0.03 * step) * line.width, line.y + 30);
      await expect.poll(() => pictures(page)).toBeGreaterThan(before);
    }
    await page.mouse.up();
    await rested(page);
    // The address follows a little later.
    const drawn = await page.locator('.live').getAttribute('data-iso');
    await expect.poll(() => noted(page, 'iso')).toBe(drawn);
    const iso = Number(drawn);
    expect(iso).toBeGreaterThan(150);
    // A ball's samples fall by 8 a millimetre.
    const radius = (value: number): number => 30 - (value - 100) / 8;
    const part = (await area(page)) / large;
    expect(part / (radius(iso) / radius(60)) ** 2).toBeGreaterThan(0.85);
    // With the cross, of which the more is seen the smaller the disc is.
    expect(part / (radius(iso) / radius(60)) ** 2).toBeLessThan(1.25);
    // Nothing but the estimate is asked for on the way.
    expect(asked.filter((path) => path.startsWith('/v1/') && path !== '/v1/estimate')).toEqual([]);
  });

  it('is drawn once for all moves that come while a picture is drawn, at the last of them', async ({ page }) => {
    await open(page, 'iso=60');
    // Drawing takes as long as the test lets it.
    await page.evaluate(() => {
      const made = WebGL2RenderingContext.prototype;
      // eslint-disable-next-line @typescript-eslint/unbound-method -- called on their contexts below
      const { clientWaitSync } = made;
      const test = { isHeld: true, drawn: [] as string[] };
      Object.assign(window, { test });
      made.clientWaitSync = function (...given) {
        return test.isHeld ? this.TIMEOUT_EXPIRED : clientWaitSync.apply(this, given);
      };
      const cell = document.querySelector<HTMLElement>('.live');
      if (!cell) throw new Error('there is no surface');
      const note = (): number => test.drawn.push(cell.dataset.iso ?? '');
      new MutationObserver(note).observe(cell, { attributes: true, attributeFilter: ['data-moving', 'data-resting'] });
    });
    const input = page.getByLabel('Iso-value', { exact: true }).nth(0);
    for (let iso = 61; iso <= 90; iso += 1) await input.fill(String(iso));
    const drawn = await page.evaluate(() => {
      const { test } = window as unknown as { test: { isHeld: boolean; drawn: string[] } };
      const before = [...test.drawn];
      test.isHeld = false;
      return before;
    });
    expect(drawn).toEqual([]);
    await rested(page);
    await expect.poll(() => page.locator('.live').getAttribute('data-iso')).toBe('90');
    // The one that was being drawn when the others came, and the last.
    const values = await page.evaluate(() => (window as unknown as { test: { drawn: string[] } }).test.drawn);
    expect(new Set(values).size).toBeLessThanOrEqual(2);
    expect(values.at(-1)).toBe('90');
  });

  it('is turned by keys and by the pointer, and sends the slices to where it is clicked', async ({ page }) => {
    await open(page, 'iso=100&at=2,3,4');
    const canvas = page.locator('.live canvas');
    const box = await boxOf(canvas);
    await canvas.click({ position: { x: box.width / 2, y: box.height / 2 } });
    await expect.poll(() => noted(page, 'at')).not.toBe('2,3,4');
    const place = noted(page, 'at').split(',').map(Number);
    // On the ball, on the side that is seen: from the front and the patient's left.
    expect(Math.hypot(...place.map((value) => value - 39.5))).toBeGreaterThan(28);
    expect(Math.hypot(...place.map((value) => value - 39.5))).toBeLessThan(32);
    expect(place[1]).toBeLessThan(30);
    // Another side is seen each time.
    for (let n = 0; n < 4; n += 1) await canvas.press('ArrowRight');
    await canvas.click({ position: { x: box.width / 2, y: box.height / 2 } });
    await expect.poll(() => noted(page, 'at')).not.toBe(place.join(','));
    const byKeys = await settled(page, () => noted(page, 'at'));
    await drag(page, [box.x + 100, box.y + 100], [box.x + 160, box.y + 100]);
    await rested(page);
    await canvas.click({ position: { x: box.width / 2, y: box.height / 2 } });
    await expect.poll(() => noted(page, 'at')).not.toBe(byKeys);
  });

  it('says why there is none', async ({ page, daemon }) => {
    await open(page, 'iso=100');
    await page.getByLabel('Iso-value', { exact: true }).nth(0).fill('9999');
    await expect.poll(() => page.locator('.live .slice-state').innerText()).toMatch(/not between the smallest and the largest sample/);
    await expect.poll(() => page.locator('.live-picture').isVisible()).toBe(false);
    await page.getByLabel('Iso-value', { exact: true }).nth(0).fill('100');
    await expect.poll(() => page.locator('.live-picture').isVisible()).toBe(true);
    const labels = await daemon.upload(labelsNrrd(24));
    await page.goto(`${daemon.url}/#/volumes/${labels}`);
    await expect.poll(async () => (await page.locator('.live canvas').getAttribute('aria-label')) ?? '').toMatch(/labels/);
  });

  it('comes when the daemon has it again', async ({ page }) => {
    await page.route('**/preview?*', (route) => route.fulfill({ status: 500, body: '' }));
    await page.goto(`${at.daemon.url}/#/volumes/${ball}?iso=100`);
    await expect.poll(() => page.locator('.live .slice-state').innerText()).toMatch(/could not be loaded/);
    await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(50);
    await page.unroute('**/preview?*');
    await rested(page);
    await expect.poll(() => page.locator('.live .slice-state').innerText()).toBe('');
  });
});
