// The document is never taller or wider than the window: views scroll inside, and the header stays.
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { ballNrrd, labelsNrrd, setup, surfaceLoaded } from './support';

const { at, it } = setup();
const sizes = {
  'a phone': { width: 390, height: 844 },
  'a desktop': { width: 1400, height: 900 },
  // What is left of it when everything is twice as large.
  'a desktop at 200 %': { width: 700, height: 450 },
};
const views = new Map<string, string>();
// Parts that come later than their view.
const late = new Map([
  ['a volume', ['.estimate:not(.stale) dl', '.made ul']],
  ['a volume in many formats', ['.estimate:not(.stale) dl']],
  ['a volume of labels', ['.estimate:not(.stale) dl', '.label-choice .labels li', '.made ul']],
  ['a surface with slices', ['[data-plane=sagittal]']],
]);

beforeAll(async () => {
  const { daemon } = at;
  const volume = await daemon.upload(ballNrrd(48, 18));
  const segmented = await daemon.upload(labelsNrrd(24));
  const { id } = await daemon.make({ volume, iso: 100, certify: true, formats: ['glb'] });
  const other = await daemon.make({ volume, iso: 110, formats: ['glb'] });
  const labels = await daemon.make({ volume: segmented, labels: 'all', formats: ['glb'] });
  views.set('volumes', '');
  views.set('a volume', `volumes/${volume}`);
  views.set('a volume in many formats', `volumes/${volume}?iso=100&formats=glb,drc,stl,3mf,ply,obj,vtk,vtp,gii`);
  views.set('a volume of labels', `volumes/${segmented}`);
  views.set('jobs', 'jobs');
  views.set('a surface', `jobs/${id}`);
  views.set('a surface with slices', `jobs/${id}?slices=on`);
  views.set('labels', `jobs/${labels.id}`);
  views.set('a comparison', `compare?jobs=${id},${other.id}`);
  views.set('one scene', `together?jobs=${id},${other.id}`);
  views.set('an error', 'jobs/gone');
});

async function open(page: Page, name: string): Promise<void> {
  // From an empty page, so that nothing of the view before is taken for this one.
  await page.goto('about:blank');
  await page.goto(`${at.daemon.url}/#/${views.get(name) ?? ''}`);
  await page.locator('main h1').first().waitFor();
  await expect.poll(() => page.locator('main').getAttribute('aria-busy')).toBeNull();
  await surfaceLoaded(page, await page.locator('.pane').count());
  for (const part of late.get(name) ?? []) await page.locator(part).first().waitFor();
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
}

// How far the document can be scrolled, at each end of everything in it that scrolls.
function excess(page: Page): Promise<{ down: number; right: number; header: number }> {
  return page.evaluate(() => {
    for (const element of document.querySelectorAll('main, main *')) element.scrollTop = element.scrollHeight;
    for (const element of document.querySelectorAll('main > :last-child, .panel > :last-child')) element.scrollIntoView();
    const root = document.scrollingElement ?? document.documentElement;
    const header = document.querySelector('.top')?.getBoundingClientRect().top ?? -1;
    return { down: root.scrollHeight - window.innerHeight, right: root.scrollWidth - window.innerWidth, header };
  });
}

describe('the estimate', () => {
  it('is as tall as its texts in a panel that scrolls', async ({ page }) => {
    await page.setViewportSize({ width: 1440, height: 600 });
    await open(page, 'a volume in many formats');
    const { own, texts } = await page.locator('.estimate').evaluate((box) => ({ own: box.clientHeight, texts: box.scrollHeight }));
    expect(own).toBeGreaterThan(110);
    expect(own).toBe(texts);
  });
});

describe.each(Object.entries(sizes))('on %s', (_, size) => {
  it('no view is taller or wider than the window', async ({ page }) => {
    await page.setViewportSize(size);
    for (const name of views.keys()) {
      await open(page, name);
      expect(await excess(page), name).toEqual({ down: 0, right: 0, header: 0 });
    }
  });

  it('no choice of a parameter is cut off', async ({ page }) => {
    await page.setViewportSize(size);
    for (const name of ['a volume', 'a volume of labels']) {
      await open(page, name);
      await page.locator('.parameters summary', { hasText: 'More' }).click();
      const cut = await page.locator('.parameters .segments').evaluateAll((rows) =>
        rows.filter((row) => row.scrollWidth > row.clientWidth).map(({ textContent }) => textContent),
      );
      expect(cut, name).toEqual([]);
    }
  });

  it('the list of jobs leaves nothing out, and has no column of single words', async ({ page }) => {
    await page.setViewportSize(size);
    await open(page, 'jobs');
    const cells = await page.locator('.jobs tbody td').evaluateAll((all) =>
      all
        .filter(({ textContent }) => textContent !== '')
        .map((cell) => {
          const { left, right, height } = cell.getBoundingClientRect();
          const isSeen = cell.checkVisibility() && left >= 0 && right <= window.innerWidth;
          const padding = parseFloat(getComputedStyle(cell).paddingBlock) || 0;
          return { text: cell.textContent, isSeen, lines: (height - 2 * padding) / parseFloat(getComputedStyle(cell).lineHeight) };
        }),
    );
    // State, priority, surface, result, time, age and erasing of each of three jobs.
    expect(cells).toHaveLength(21);
    expect(cells.filter(({ isSeen, lines }) => !isSeen || lines > 3.5)).toEqual([]);
  });
});
