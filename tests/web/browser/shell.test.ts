// What is around the views: notes, titles, keys, contrast, the token.
import { readFileSync } from 'node:fs';
import type { Route } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { pixelsOf } from './seen';
import { ballNrrd, boxOf, measured, noted, openPage, openSurface, pause, settled, setup, still, withTokens } from './support';

const { at, it } = setup();
let ball: string;
let job: string;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(48, 18));
  job = (await at.daemon.make({ volume: ball, iso: 100, formats: ['glb'] })).id;
});

describe('the page', () => {
  it('tells its tabs apart, has a heading in each view, and leads on where there is nothing', async ({ page, daemon }) => {
    const titles: string[] = [];
    for (const place of ['', `volumes/${ball}`, `jobs/${job}`, 'jobs', `compare?jobs=${job},${job}`]) {
      await page.goto(`${daemon.url}/#/${place}`);
      await expect.poll(() => page.locator('main h1').count()).toBe(1);
      await expect.poll(() => page.locator('main').getAttribute('aria-busy')).toBeNull();
      titles.push(await page.title());
    }
    expect(new Set(titles).size).toBe(titles.length);
    expect(titles[2]).toContain('Surface at 100');
    await page.goto(`${daemon.url}/#/jobs/gone`);
    await expect.poll(() => page.locator('.page-problem').innerText()).toContain('The address is wrong');
    await expect.poll(() => page.locator('main h1').count()).toBe(1);
    await page.goto(`${daemon.url}/#/compare`);
    await page.getByRole('link', { name: 'Go to the list of jobs' }).click();
    await page.waitForURL(/#\/jobs$/);
  });

  it('leaves a person who went elsewhere there when a job has been accepted', async ({ page, daemon }) => {
    let answer = (): void => undefined;
    const held = new Promise<void>((resolve) => (answer = resolve));
    await page.route('**/v1/jobs', async (route) => {
      if (route.request().method() === 'POST') await held;
      await route.continue();
    });
    await page.goto(`${daemon.url}/#/volumes/${ball}`);
    await page.getByRole('button', { name: 'Make the surface' }).click();
    await page.getByRole('link', { name: 'Jobs', exact: true }).click();
    await page.locator('h1', { hasText: 'Jobs' }).waitFor();
    const accepted = page.waitForResponse((response) => response.request().method() === 'POST' && response.url().endsWith('/v1/jobs'));
    answer();
    await accepted;
    // It is told there.
    await page.locator('.toast a', { hasText: 'The surface for' }).waitFor();
    expect(new URL(page.url()).hash).toBe('#/jobs');
  });

  it('is light on paper, and without what one presses', async ({ page, daemon }) => {
    await page.emulateMedia({ colorScheme: 'dark', media: 'print' });
    for (const place of ['', `volumes/${ball}`, `jobs/${job}`, 'jobs']) {
      await page.goto(`${daemon.url}/#/${place}`);
      await expect.poll(() => page.locator('main h1').count()).toBe(1);
      await expect.poll(() => page.locator('main').getAttribute('aria-busy')).toBeNull();
      expect(await page.locator('.top').isVisible(), place).toBe(false);
      expect(await page.locator('button:visible').count(), place).toBe(0);
      expect(await page.evaluate(() => getComputedStyle(document.body).backgroundColor), place).toBe('rgb(243, 245, 246)');
    }
    await page.emulateMedia({ colorScheme: null, media: null });
  });

  it('keeps the view that was opened last, however late the one before is', async ({ page, daemon }) => {
    await page.goto(`${daemon.url}/#/volumes/${ball}`);
    await page.locator('.histogram .bars').waitFor();
    const jobs = /\/v1\/jobs(\?|$)/;
    const held: Route[] = [];
    await page.route(jobs, (route) => void held.push(route));
    await page.getByRole('link', { name: 'Jobs', exact: true }).click();
    await expect.poll(() => held.length).toBeGreaterThan(0);
    await page.goBack();
    await expect.poll(() => page.locator('main').getAttribute('aria-busy')).toBeNull();
    await pause(page, 600); // when a view that is still to come says that it loads
    for (const route of held) await route.continue();
    for (const route of held) await (await route.request().response())?.finished();
    await pause(page, 500); // until a view is made of these responses
    expect(await page.locator('.histogram .bars').count()).toBe(1);
    expect(await page.locator('.loading').count()).toBe(0);
  });

  it('shows where one is also in colours that a person forces', async ({ page, daemon }) => {
    await page.emulateMedia({ forcedColors: 'active' });
    await page.goto(`${daemon.url}/#/volumes/${ball}`);
    await page.locator('.histogram .bars').waitFor();
    const line = (selector: string): Promise<string> =>
      page.locator(selector).evaluate((element) => getComputedStyle(element).borderBottomColor);
    expect(await line('.top nav a[aria-current]')).not.toBe(await line('.top nav a:not([aria-current]):not([hidden])'));
    const [bars, ground] = await page.evaluate(() => [
      getComputedStyle(document.querySelector('.histogram .bars') as Element).fill,
      getComputedStyle(document.body).backgroundColor,
    ]);
    expect(bars).not.toBe(ground);
  });

  it('covers no button with its notes, and lets nothing out of its boxes', async ({ page, daemon }) => {
    await page.goto(`${daemon.url}/#/volumes/${ball}?iso=100&formats=glb,drc,stl,ply,obj`);
    await expect.poll(() => page.locator('.estimate dl').count()).toBe(1);
    const isIn = await page.locator('.estimate').evaluate((box) => box.scrollWidth <= box.clientWidth);
    expect(isIn).toBe(true);
    await page.evaluate(() => document.querySelector('.toasts')?.append(Object.assign(document.createElement('div'), { className: 'toast', textContent: 'A note that is as long as notes are, of two lines or of three' })));
    const toast = await page.locator('.toast').boundingBox();
    const run = await page.getByRole('button', { name: 'Make the surface' }).boundingBox();
    expect((toast?.x ?? 0) + (toast?.width ?? 0)).toBeLessThan(run?.x ?? 0);
  });
});

describe('a surface', () => {
  it('has its keys also while a slider has the focus', async ({ page }) => {
    await openSurface(at, job);
    await page.getByLabel('Opacity').and(page.locator('input')).focus();
    await page.keyboard.press('a');
    await expect.poll(async () => Math.abs(Number((await settled(page, () => noted(page, 'cam'))).split(',')[0]))).toBeLessThan(1);
  });

  it('is turned when a cut would be seen edge-on', async ({ page }) => {
    await openSurface(at, job);
    await page.keyboard.press('a');
    const slice = page.waitForResponse(/slice\.png/);
    await page.keyboard.press('c');
    await slice;
    const height = async (): Promise<number> => {
      const [x = 0, y = 0, z = 0] = (await settled(page, () => noted(page, 'cam'))).split(',').map(Number);
      return Math.abs(z) / Math.hypot(x, y, z);
    };
    await expect.poll(height).toBeGreaterThan(0.4);
  });

  it('has its distances in its picture', async ({ page }) => {
    await openSurface(at, job);
    await page.keyboard.press('a');
    await still(page);
    await measured(page, 60);
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Picture' }).click();
    const pixels = await pixelsOf(page, readFileSync(await (await download).path()));
    const label = await pixels.evaluate(({ data }) => {
      let count = 0;
      for (let i = 0; i < data.length; i += 4) {
        if (data[i] === 0x17 && data[i + 1] === 0xa3 && data[i + 2] === 0x98) count += 1;
      }
      return count;
    });
    // The line alone has some hundred.
    expect(label).toBeGreaterThan(600);
    // Twice as fine as the screen, and nothing is behind the surface.
    const view = await page.locator('.viewport').boundingBox();
    const { width, height, corner, black, scale } = await pixels.evaluate((picture) => {
      const { data } = picture;
      let dark = 0;
      // The scale bar is the only dark thing in the lower right corner. It grows with the picture.
      const scale = Math.min(picture.width, 2 * picture.height) / 450;
      for (let x = picture.width - Math.round(50 * scale); x < picture.width; x += 1) {
        const at = 4 * ((picture.height - Math.round(16 * scale)) * picture.width + x);
        if (data[at] === 0x11 && data[at + 3] === 255) dark += 1;
      }
      return { width: picture.width, height: picture.height, corner: data[3], black: dark, scale };
    });
    expect([width, height]).toEqual([2 * Math.floor(view?.width ?? 0), 2 * Math.floor(view?.height ?? 0)]);
    expect(corner).toBe(0);
    expect(scale).toBeGreaterThan(2.5);
    expect(black).toBeGreaterThan(25 * scale);
  });
});

describe('the token', () => {
  it('is asked for again after its dialog was closed', async ({ browser }) => {
    await withTokens(async (guarded, token) => {
      const { page } = await openPage(browser, guarded.url);
      await page.goto(guarded.url);
      await page.locator('dialog').waitFor();
      await page.keyboard.press('Escape');
      await page.keyboard.press('Escape');
      await expect.poll(() => page.locator('dialog').count()).toBe(0);
      // In the next view, and by the button.
      await page.getByRole('link', { name: 'Jobs', exact: true }).click();
      await page.locator('dialog').waitFor();
      await page.keyboard.press('Escape');
      await page.getByRole('button', { name: 'Enter a token' }).click();
      const field = page.getByLabel('Token', { exact: true }).and(page.locator('input'));
      await field.fill(token);
      await page.getByRole('button', { name: 'Continue' }).click();
      await expect.poll(() => page.getByRole('heading', { name: 'Jobs' }).count()).toBe(1);
      await expect.poll(() => page.getByRole('button', { name: 'Enter a token' }).isVisible()).toBe(false);
      await page.close();
    });
  });
});

describe('small things', () => {
  it('stay where they are: help at its beginning, the panel after a change; an unknown address is told as one', async ({ page, daemon }) => {
    await page.setViewportSize({ width: 1180, height: 420 });
    await page.goto(`${daemon.url}/#/nowhere`);
    const refused = page.getByRole('alert').filter({ hasText: 'No page has this address.' });
    await refused.waitFor();
    expect(await refused.innerText()).not.toContain('erased');
    await page.keyboard.press('?');
    const help = page.getByRole('dialog', { name: 'Keyboard shortcuts' });
    await help.waitFor();
    expect(await help.evaluate((dialog) => dialog.scrollHeight > dialog.clientHeight && dialog.scrollTop)).toBe(0);
    await page.keyboard.press('Escape');
    const volume = await daemon.upload(ballNrrd(16, 5));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
    const below = page.locator('.slice-controls');
    const before = await boxOf(below);
    await page.locator('.iso-input').fill('110');
    await page.getByRole('button', { name: 'Undo' }).waitFor();
    expect(await boxOf(below)).toEqual(before);
  });
});
