// A phone: 375 by 667, with fingers.
import type { Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { contourPixels } from './seen';
import { ballNrrd, boxOf, holdMeshes, labelsNrrd, noted, openSurface, settled, setup, surfaceLoaded } from './support';

const { at, it } = setup({ viewport: { width: 375, height: 667 }, hasTouch: true, isMobile: true });

function scrolled(page: Page): Promise<number> {
  return page.evaluate(() => document.querySelector('main')?.scrollTop ?? 0);
}

async function swipe(page: Page, x: number, from: number, to: number): Promise<void> {
  const session = await page.context().newCDPSession(page);
  const touch = (type: 'touchStart' | 'touchMove' | 'touchEnd', y?: number): Promise<unknown> =>
    session.send('Input.dispatchTouchEvent', { type, touchPoints: y === undefined ? [] : [{ x, y, id: 0 }] });
  await touch('touchStart', from);
  for (let step = 1; step <= 10; step += 1) await touch('touchMove', from + (step / 10) * (to - from));
  await touch('touchEnd');
  await session.detach();
}

describe('on a phone', () => {
  it('a swipe on a slice scrolls, and the window stays', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
    await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(20);
    const window = await settled(page, () => noted(page, 'window'));
    for (let n = 0; n < 3; n += 1) await swipe(page, 90, 150, 60);
    await expect.poll(() => scrolled(page)).toBeGreaterThan(100);
    expect(noted(page, 'window')).toBe(window);
    await page.evaluate(() => document.querySelector('main')?.scrollTo(0, 0));
    // The histogram is seen together with the slices, and dragging it scrolls nothing.
    const line = await boxOf(page.locator('.histogram'));
    expect(line.y + line.height).toBeLessThan(667 - 60);
    for (const plane of ['axial', 'coronal', 'sagittal']) {
      const slice = await page.locator(`[data-plane=${plane}]`).boundingBox();
      expect((slice?.y ?? 999) + (slice?.height ?? 0), plane).toBeLessThanOrEqual(line.y);
    }
    expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBe(375);
  });

  it('slices have room beside their captions, and each can be enlarged', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    for (const width of [390, 320]) {
      await page.setViewportSize({ width, height: 844 });
      await page.goto('about:blank');
      await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
      await expect.poll(() => page.locator('[data-plane=axial] .slice-value').innerText()).not.toBe('');
      await expect.poll(() => page.locator('.live-place').innerText()).not.toBe('');
      for (const pane of await page.locator('.slice:not([hidden])').all()) {
        const [whole, caption, enlarge] = await Promise.all([pane, pane.locator('figcaption'), pane.locator('.enlarge')].map((one) => one.boundingBox()));
        if (!whole || !caption || !enlarge) throw new Error('a slice has no caption');
        expect(caption.height).toBeLessThan(0.45 * whole.height);
        expect(enlarge.x + enlarge.width).toBeLessThanOrEqual(whole.x + whole.width);
        expect(enlarge.y + enlarge.height).toBeLessThanOrEqual(whole.y + whole.height);
      }
      for (const reading of await page.locator('.slice-value').all()) expect((await reading.boundingBox())?.height ?? 0).toBeLessThan(24);
      await page.locator('[data-plane=axial] .enlarge').tap();
      await expect.poll(() => page.locator('[data-plane=axial] .slice-value').innerText()).toContain('LPS');
    }
  });

  it('nothing goes beyond the edge, and what is loaded is told below the tools', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    // The space at the right is as wide as that at the left.
    const rightOf = (selector: string): Promise<number> =>
      page.locator(selector).evaluateAll((all) => Math.max(...all.map((element) => element.getBoundingClientRect().right)));
    await page.setViewportSize({ width: 320, height: 844 });
    await page.goto(daemon.url);
    await page.locator('[data-volume]').first().waitFor();
    expect(await rightOf('.home section, .home section > *, .volume-search, .card')).toBeLessThanOrEqual(300);
    await holdMeshes(page);
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await expect.poll(() => page.locator('.load-status').innerText()).not.toBe('');
    const [status, tools] = await Promise.all(['.load-status', '.tools'].map((one) => page.locator(one).boundingBox()));
    expect(status?.y).toBeGreaterThan((tools?.y ?? 999) + (tools?.height ?? 999));
    expect(await rightOf('.panel > *, .panel-section > *, .panel .stack > *')).toBeLessThanOrEqual(304);
  });

  it('a tap on a label leaves the page where it is', async ({ page, daemon }) => {
    const volume = await daemon.upload(labelsNrrd(24));
    const { id } = await daemon.make({ volume, labels: 'all', formats: ['glb'] });
    await openSurface(at, id);
    await page.locator('.viewport canvas').tap();
    await expect.poll(() => page.locator('.labels [aria-current]').count()).toBe(1);
    expect(await page.locator('.picked-label').isVisible()).toBe(true);
    expect(await scrolled(page)).toBe(0);
  });

  it('jobs are cards that a finger can choose', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await page.goto(`${daemon.url}/#/jobs`);
    const card = page.locator(`[data-job="${id}"]`);
    await card.waitFor();
    // As before to those who hear it.
    expect(await page.getByRole('row').count()).toBeGreaterThan(1);
    await card.getByRole('checkbox').tap();
    expect(await card.getByRole('checkbox').isChecked()).toBe(true);
  });

  it('nothing that is pressed is smaller than 24 pixels', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const segmented = await daemon.upload(labelsNrrd(24));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'], certify: true });
    const labels = await daemon.make({ volume: segmented, labels: 'all', formats: ['glb', 'stl'] });
    const found: string[] = [];
    for (const place of ['', `volumes/${volume}`, `volumes/${segmented}`, 'jobs', `jobs/${id}?cut=z24%2B`, `jobs/${labels.id}`, `together?jobs=${id},${labels.id}`]) {
      await page.goto(`${daemon.url}/#/${place}`);
      await page.locator('main h1').first().waitFor();
      await expect.poll(() => page.locator('main').getAttribute('aria-busy')).toBeNull();
      const panes = await page.locator('.pane').count();
      if (panes > 0) await surfaceLoaded(page, panes);
      const small = await page.evaluate(() =>
        [...document.querySelectorAll<HTMLElement>('a[href], button, input, select, summary')]
          // Links in a text are as large as its lines. What cannot be seen cannot be pressed; a label is pressed for its control.
          .filter((one) => getComputedStyle(one).display !== 'inline' && one.checkVisibility({ opacityProperty: true }))
          .map((one) => one.closest('label') ?? one)
          .map((one) => ({ text: `${one.tagName} ${one.className} ${one.textContent}`, box: one.getBoundingClientRect() }))
          .filter(({ box }) => box.width > 0 && Math.min(box.width, box.height) < 23.5)
          .map(({ text, box }) => `${text} ${Math.round(box.width)} x ${Math.round(box.height)}`),
      );
      found.push(...small.map((text) => `${place} ${text}`));
    }
    expect(found).toEqual([]);
  });

  it('what controls a cut is on the screen', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await openSurface(at, id);
    await page.getByRole('button', { name: 'Cut' }).tap();
    for (const element of await page.locator('.cut-controls > *').all()) {
      const box = await element.boundingBox();
      expect(box?.x).toBeGreaterThanOrEqual(0);
      expect((box?.x ?? 0) + (box?.width ?? 999)).toBeLessThanOrEqual(375);
    }
  });
});
