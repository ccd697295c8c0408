// Looks through a volume, and slices beside a surface.
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { contourPixels, silhouette } from './seen';
import { ballNrrd, ballsNrrd, boxOf, type JobAnswer, noted, openSurface, settled, setup, still } from './support';

const { at, it } = setup();
const size = 48;
let ball: string;
let made: JobAnswer;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(size, 18));
  made = await at.daemon.make({ volume: ball, iso: 100, formats: ['glb'] });
});

async function rested(page: Page): Promise<void> {
  await expect.poll(() => page.locator('.live[data-size] .live-picture[data-still]').count()).toBe(1);
}

describe('a look through the volume', () => {
  it('shows more than its surface, is kept by the address, and gives way to the surface', async ({ page, daemon }) => {
    await page.goto(`${daemon.url}/#/volumes/${ball}?iso=200`);
    await rested(page);
    const view = page.locator('.live-picture');
    const surface = await silhouette(page, view);
    const choice = page.getByLabel('Kind of preview');
    await expect.poll(() => choice.locator('option').allInnerTexts()).toEqual(['Surface', 'MR']);
    await choice.selectOption('MR');
    await rested(page);
    // Values far below the iso-value are seen as well.
    const through = await silhouette(page, view);
    expect(through.part).toBeGreaterThan(1.5 * surface.part);
    expect(await settled(page, () => noted(page, 'look'))).toBe('MR');
    await page.reload();
    await rested(page);
    expect((await silhouette(page, view)).part / through.part).toBeCloseTo(1, 1);
    await choice.selectOption('');
    await rested(page);
    expect((await silhouette(page, view)).part / surface.part).toBeCloseTo(1, 1);
    expect(await settled(page, () => noted(page, 'look'))).toBe('');
  });
});

describe('slices beside a surface', () => {
  async function open(page: Page, query = ''): Promise<void> {
    await page.goto('about:blank');
    await openSurface(at, `${made.id}${query}`);
  }

  it('go to where the surface is clicked, and its cross to where they are clicked', async ({ page }) => {
    await open(page);
    await page.keyboard.press('a');
    await page.getByRole('button', { name: 'Slices' }).click();
    await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(50);
    await expect.poll(() => noted(page, 'at')).toBe('24,24,24');
    const canvas = await boxOf(page.locator('.viewport canvas'));
    await still(page);
    await page.mouse.click(canvas.x + canvas.width / 2, canvas.y + canvas.height / 2);
    // From the front the middle of the ball is its foremost point.
    await expect.poll(() => noted(page, 'at')).toMatch(/^2[34],[56],2[34]$/);
    await expect.poll(() => page.locator('[data-plane=coronal] .slice-place').innerText()).toMatch(/^[67] \/ 48$/);

    await still(page);
    const before = await page.locator('.viewport').screenshot();
    const slice = await boxOf(page.locator('[data-plane=axial] canvas'));
    await page.mouse.click(slice.x + 0.6 * slice.width, slice.y + 0.7 * slice.height);
    await expect.poll(() => Number(noted(page, 'at').split(',')[1])).toBeGreaterThan(25);
    await still(page);
    // Its place is told before it is drawn.
    await expect.poll(async () => before.equals(await page.locator('.viewport').screenshot())).toBe(false);
    const place = await settled(page, () => noted(page, 'at'));

    await open(page, `?slices=on&at=${place}`);
    await expect.poll(() => contourPixels(page, 'sagittal')).toBeGreaterThan(20);
    await expect.poll(() => page.getByRole('button', { name: 'Slices' }).getAttribute('aria-pressed')).toBe('true');
    await page.keyboard.press('x');
    await expect.poll(() => page.locator('[data-plane]').count()).toBe(0);
    await still(page);
    expect((await silhouette(page, page.locator('.viewport'))).part).toBeGreaterThan(0.1);
  });

  it('are not offered where the volume is gone', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballsNrrd(24));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await fetch(`${daemon.url}/v1/volumes/${volume}`, { method: 'DELETE' });
    await openSurface(at, id);
    await expect.poll(() => page.getByRole('button', { name: 'Slices' }).count()).toBe(0);
    await expect.poll(() => page.getByRole('button', { name: 'Measure' }).count()).toBe(1);
  });
});
