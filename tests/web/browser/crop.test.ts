// Slices that are enlarged, and a box that a job is cropped to.
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { contourPixels, silhouette } from './seen';
import { ballNrrd, ballsNrrd, boxOf, drag, madeJob, noted, settled, setup } from './support';

const { at, it } = setup();
const size = 48;
let ball: string;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(size, 18));
});

async function open(page: Page, query: string): Promise<{ x: number; y: number; width: number; height: number }> {
  await page.goto('about:blank');
  await page.goto(`${at.daemon.url}/#/volumes/${ball}?${query}`);
  await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(50);
  await expect.poll(() => page.locator('.live[data-size] .live-picture[data-still]').count()).toBe(1);
  const box = await boxOf(page.locator('[data-plane=axial] canvas'));
  return box;
}

describe('a slice', () => {
  it('is enlarged at the pointer, moved, and clicked where it is seen', async ({ page }) => {
    const box = await open(page, 'iso=100&at=24,24,24');
    const before = await contourPixels(page, 'axial');
    const middle = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    await page.mouse.move(middle.x, middle.y);
    await page.keyboard.down('Control');
    for (let step = 0; step < 21; step += 1) await page.mouse.wheel(0, -60);
    await page.keyboard.up('Control');
    const chip = page.locator('[data-plane=axial] .slice-zoom');
    await expect.poll(() => chip.innerText()).toMatch(/^7\.4 ×$/);
    // The contour is outside of what is seen, and no slice was left for another one.
    await expect.poll(() => contourPixels(page, 'axial')).toBeLessThan(before / 4);
    await expect.poll(() => page.locator('[data-plane=axial] .slice-place').innerText()).toBe('25 / 48');
    const side = (Math.min(box.width, box.height) - 28) / size; // of a sample
    await page.mouse.click(middle.x + 2.5 * 7.389 * side, middle.y);
    await expect.poll(() => noted(page, 'at')).toMatch(/^2[67],2[34],24$/);
    const place = await settled(page, () => noted(page, 'at'));

    await page.keyboard.down('Shift');
    await drag(page, [middle.x, middle.y], [middle.x - 3 * 7.389 * side, middle.y]);
    await page.keyboard.up('Shift');
    // Moving is neither a click nor another window.
    expect(await settled(page, () => noted(page, 'at'))).toBe(place);
    await page.mouse.click(middle.x, middle.y);
    // As far from the middle of the volume as the slice was moved.
    expect(Number((await settled(page, () => noted(page, 'at'))).split(',')[0])).toBeGreaterThan(25);

    await page.locator('[data-plane=axial] canvas').press('0');
    await expect.poll(() => chip.isVisible()).toBe(false);
    await page.locator('[data-plane=axial] canvas').press('+');
    await expect.poll(() => chip.innerText()).toBe('1.3 ×');
    await chip.click();
    await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(0.8 * before);
  });
});

describe('a crop', () => {
  it('is drawn in slices and surface, dragged, and made', async ({ page }) => {
    const box = await open(page, 'iso=100');
    const view = page.locator('.live-picture');
    const whole = await silhouette(page, view);
    await page.getByLabel('Crop to a box').check();
    await expect.poll(async () => (await settled(page, () => noted(page, 'crop'))) !== '').toBe(true);
    expect(await settled(page, () => noted(page, 'crop'))).toBe('7,7,7,40,40,40');
    // Its right edge, which is at sample 40, to the middle.
    const side = (Math.min(box.width, box.height) - 28) / size;
    const place = (sample: number): number => (sample + 0.5 - size / 2) * side;
    const middle = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    await drag(page, [middle.x + place(40), middle.y], [middle.x + place(24), middle.y]);
    await expect.poll(() => noted(page, 'crop')).toMatch(/^7,7,7,2[345],40,40$/);
    await page.getByLabel('Last sample along x').fill('23');
    await page.getByLabel('Last sample along x').press('Enter');
    expect(await settled(page, () => noted(page, 'crop'))).toBe('7,7,7,23,40,40');
    await expect.poll(() => page.locator('.live-picture[data-still]').count()).toBe(1);
    const half = (await silhouette(page, view)).part / whole.part;
    expect(half).toBeLessThan(0.85);
    expect(half).toBeGreaterThan(0.3);
    await page.getByRole('button', { name: 'Make the surface' }).click();
    await page.waitForURL(/#\/jobs\//);
    const { mesh } = await madeJob(at);
    expect(mesh?.bounds[1][0]).toBeCloseTo(23, 3);
  });
});

describe('a surface in parts', () => {
  it('offers to keep the largest', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballsNrrd(40));
    const { id, mesh } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    expect(mesh?.components).toBe(2);
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await page.getByRole('button', { name: 'Keep the largest' }).click();
    await expect.poll(() => page.url()).not.toContain(id);
    const largest = await madeJob(at);
    expect(largest.mesh?.components).toBe(1);
    expect(largest.mesh?.triangles).toBeGreaterThan(0.6 * (mesh?.triangles ?? 0));
  });
});
