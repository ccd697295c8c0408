// Planes at any angle: one beside the slices, and one that cuts a surface. And how panes are laid out.
import type { Locator, Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { contourPixels, silhouette } from './seen';
import { ballNrrd, boxOf, drag, noted, openSurface, setup, still, surfaceLoaded } from './support';

const { at, it } = setup();
let ball: string;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(64, 24));
});

async function openOblique(page: Page): Promise<Locator> {
  await page.goto(`${at.daemon.url}/#/volumes/${ball}?iso=100&at=32,32,32`);
  await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(50);
  await page.getByLabel('Oblique plane', { exact: true }).check();
  const picture = page.locator('.oblique-picture[data-angles]');
  await picture.waitFor();
  return picture;
}

// The part of the plane where there is something.
function filled(picture: Locator): Promise<number> {
  return picture.evaluate((canvas: HTMLCanvasElement) => {
    const { data = [] } = canvas.getContext('2d', { willReadFrequently: true })?.getImageData(0, 0, canvas.width, canvas.height) ?? {};
    let bright = 0;
    for (let at = 0; at < data.length; at += 4) if ((data[at] ?? 0) > 100) bright += 1;
    return bright / (canvas.width * canvas.height);
  });
}

const disc = (Math.PI * 24 ** 2) / 64 ** 2;

describe('an oblique plane', () => {
  it('shows the same of a ball at any angle, and is turned by its handle and by keys', async ({ page }) => {
    const picture = await openOblique(page);
    expect(await picture.getAttribute('data-angles')).toBe('30,0');
    await expect.poll(() => filled(picture)).toBeGreaterThan(0.9 * disc);
    const canvas = page.locator('[data-plane=axial] canvas');
    const box = await boxOf(canvas);
    // The handle is in the colour of the line, on a slice of grey; it lies a third of the volume from its middle.
    const middle = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    const handle = await canvas.evaluate((one: HTMLCanvasElement) => {
      const { width, height } = one;
      const data = one.getContext('2d', { willReadFrequently: true })?.getImageData(0, 0, width, height).data ?? [];
      const isViolet = (x: number, y: number): boolean => {
        const place = 4 * (y * width + x);
        return Math.abs((data[place] ?? 0) - 199) < 12 && Math.abs((data[place + 1] ?? 0) - 146) < 12 && Math.abs((data[place + 2] ?? 0) - 234) < 12;
      };
      let best = { x: 0, y: 0, count: 0 };
      for (let y = 4; y < height - 4; y += 1) {
        for (let x = 4; x < width - 4; x += 1) {
          let count = 0;
          for (let d = -4; d <= 4; d += 2) for (let e = -4; e <= 4; e += 2) if (isViolet(x + d, y + e)) count += 1;
          if (count > best.count) best = { x, y, count };
        }
      }
      return { x: (best.x / width) * one.clientWidth, y: (best.y / height) * one.clientHeight };
    });
    await drag(page, [box.x + handle.x, box.y + handle.y], [middle.x + 80, middle.y + 80]);
    await expect.poll(() => picture.getAttribute('data-angles')).toBe('45,0');
    // The slices stay where they are.
    expect(noted(page, 'at')).toBe('32,32,32');
    await page.getByLabel('Tilt of the oblique plane').focus();
    for (let step = 0; step < 5; step += 1) await page.keyboard.press('ArrowRight');
    await expect.poll(() => picture.getAttribute('data-angles')).toBe('45,5');
    expect(Math.abs((await filled(picture)) / disc - 1)).toBeLessThan(0.1);
    // By a drag on the plane itself, and along its normal, where the ball ends.
    await picture.dragTo(picture, { sourcePosition: { x: 60, y: 60 }, targetPosition: { x: 60, y: 160 } });
    await expect.poll(() => picture.getAttribute('data-angles')).not.toBe('45,5');
    await picture.focus();
    for (let step = 0; step < 40; step += 1) await page.keyboard.press('ArrowUp');
    await expect.poll(() => noted(page, 'at')).not.toBe('32,32,32');
    await expect.poll(() => filled(picture)).toBeLessThan(0.5 * disc);
    await page.getByLabel('Oblique plane', { exact: true }).uncheck();
    await expect.poll(() => picture.isVisible()).toBe(false);
  });

  it('is enlarged and taken away, and the panes are laid out otherwise', async ({ page }) => {
    const picture = await openOblique(page);
    const before = await picture.boundingBox();
    await page.getByRole('button', { name: 'Enlarge the oblique plane' }).click();
    await expect.poll(async () => (await picture.boundingBox())?.width ?? 0).toBeGreaterThan(1.2 * (before?.width ?? Infinity));
    await page.getByLabel('Oblique plane', { exact: true }).uncheck();
    const axial = page.locator('[data-plane=axial]');
    await expect.poll(() => axial.isVisible()).toBe(true);
    const sizeOf = async (one: Locator): Promise<number> => {
      const { width = 0, height = 0 } = (await one.boundingBox()) ?? {};
      return width * height;
    };
    const coronal = page.locator('[data-plane=coronal]');
    await page.getByLabel('Layout', { exact: true }).selectOption('First large');
    await expect.poll(async () => (await sizeOf(axial)) / (await sizeOf(coronal))).toBeGreaterThan(4);
    await page.getByLabel('Layout', { exact: true }).selectOption('Side by side');
    await expect.poll(async () => (await axial.boundingBox())?.y === (await page.locator('.live').boundingBox())?.y).toBe(true);
    await page.getByLabel('Layout', { exact: true }).selectOption('All alike');
    await expect.poll(async () => Math.abs((await sizeOf(axial)) / (await sizeOf(coronal)) - 1)).toBeLessThan(0.05);
  });
});

describe('a cut', () => {
  it('shows no other slice where its own cannot be fetched', async ({ page, daemon }) => {
    const { id } = await daemon.make({ volume: ball, iso: 100, formats: ['glb'] });
    await openSurface(at, `${id}?cut=z24%2B`);
    const slice = page.locator('.viewport[data-slice]');
    await slice.waitFor();
    await page.route('**/slice.png*', (route) => route.fulfill({ status: 500, contentType: 'application/problem+json', body: '{"title":"Internal error","status":500}' }));
    await page.getByLabel('Position of the cut').fill('30');
    await expect.poll(() => slice.count()).toBe(0);
    await page.unroute('**/slice.png*');
    await page.getByLabel('Position of the cut').fill('31');
    await page.locator('.viewport[data-slice="z/31"]').waitFor();
  });
});

describe('a free cut', () => {
  it('is parallel to the screen, is moved, and is in the address', async ({ page, daemon }) => {
    const { id } = await daemon.make({ volume: ball, iso: 100, formats: ['glb'] });
    await openSurface(at, id);
    const view = page.locator('.viewport');
    await page.getByRole('button', { name: 'Cut', exact: true }).click();
    await page.getByLabel('Direction of the cut').selectOption('Free');
    await page.locator('.viewport[data-slice^=f]').waitFor();
    await still(page);
    await expect.poll(() => noted(page, 'cut')).toMatch(/^f(-?[\d.]+,){3}0$/);
    // The middle of a ball seen from the cut side is its largest section, flat and bright.
    const half = await silhouette(page, view);
    expect(half.part).toBeGreaterThan(0.1);
    const slider = page.getByLabel('Position of the cut');
    await slider.fill('18');
    await expect.poll(() => noted(page, 'cut')).toMatch(/,18$/);
    await still(page);
    // What stays is the farther part, behind a smaller section.
    const cap = await silhouette(page, view);
    expect(cap.part).toBeLessThan(0.95 * half.part);
    const place = page.url();
    await page.goto('about:blank');
    await page.goto(place);
    await surfaceLoaded(page);
    await page.locator('.viewport[data-slice^=f]').waitFor();
    await still(page);
    expect((await silhouette(page, view)).part).toBeCloseTo(cap.part, 2);
    await page.getByRole('button', { name: 'Other side' }).click();
    await expect.poll(() => noted(page, 'cut')).toMatch(/,-18$/);
    await page.getByLabel('Direction of the cut').selectOption('Axial');
    await expect.poll(() => noted(page, 'cut')).toMatch(/^z/);
  });
});
