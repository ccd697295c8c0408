// The address keeps how a surface is looked at; changes are taken back; notes of jobs; the list of volumes.
import { describe, expect } from 'vitest';
import { smallNrrd } from './files';
import { silhouette } from './seen';
import { ballNrrd, boxOf, keepNotices, measured, noiseNrrd, noted, openPage, openSurface, pause, settled, setup, still, surfaceLoaded } from './support';

const { at, it, alone } = setup();

describe('a link to a surface', () => {
  it('carries its camera, cut, style and measurements', async ({ page, daemon, browser }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await openSurface(at, id);
    await page.keyboard.press('a');
    await still(page);
    const length = await measured(page, 60);
    await page.keyboard.press('m');
    await page.keyboard.press('t');
    await page.getByLabel('Opacity').fill('0.6');
    await page.keyboard.press('c');
    await page.getByLabel('Position of the cut').fill('20');
    await page.getByLabel('Other side').check();
    await still(page);
    await expect.poll(() => [noted(page, 'cut'), noted(page, 'style')]).toEqual(['z20-', 'flat,opacity-60']);
    expect(noted(page, 'rulers').split(',')).toHaveLength(6);
    const address = await settled(page, () => page.url());
    await page.getByLabel('Link to this surface').focus();
    await expect.poll(() => page.getByLabel('Link to this surface').inputValue()).toBe(address);
    await page.getByLabel('Link to this surface').blur();
    const seen = await silhouette(page, page.locator('.viewport'));

    const { page: other, faults } = await openPage(browser, daemon.url);
    await other.goto(address);
    await surfaceLoaded(other);
    await expect.poll(() => other.locator('.ruler-labels span').innerText()).toBe(length);
    await expect.poll(() => other.locator('.cut-place').innerText()).toBe('21 / 48');
    await expect.poll(() => other.getByLabel('Other side').isChecked()).toBe(true);
    await expect.poll(() => other.getByRole('button', { name: 'Flat' }).getAttribute('aria-pressed')).toBe('true');
    await expect.poll(() => other.getByLabel('Opacity').inputValue()).toBe('0.6');
    await expect.poll(async () => (await silhouette(other, other.locator('.viewport'))).part / seen.part).toBeCloseTo(1, 1);
    // What is taken away leaves the address.
    for (const key of ['c', 't', 'Delete']) await other.keyboard.press(key);
    await expect.poll(() => [noted(other, 'cut'), noted(other, 'style'), noted(other, 'rulers')]).toEqual(['', 'opacity-60', '']);
    await other.close();
    expect(faults).toEqual([]);
  });
});

describe('parameters', () => {
  it('are taken back and done again', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(32, 12));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
    const undo = page.getByRole('button', { name: 'Undo' });
    const passes = page.locator('[data-parameter=passes] input');
    const changed = (): string[] => [noted(page, 'passes'), noted(page, 'smoothing')];
    await page.locator('.parameters summary').click();
    await passes.waitFor();
    await expect.poll(() => undo.isVisible()).toBe(false);
    await passes.fill('9');
    await expect.poll(changed).toEqual(['9', '']);
    // A click ends what was typed before, so that these are two changes.
    await page.locator('[data-parameter=smoothing] label', { hasText: 'Taubin' }).click();
    await expect.poll(changed).toEqual(['9', 'taubin']);
    await undo.click();
    await expect.poll(changed).toEqual(['9', '']);
    await expect.poll(() => passes.inputValue()).toBe('9');
    await page.keyboard.press('Control+z');
    await expect.poll(changed).toEqual(['', '']);
    await expect.poll(() => passes.inputValue()).toBe('5');
    await expect.poll(() => undo.isVisible()).toBe(false);
    for (const both of [['9', ''], ['9', 'taubin']]) {
      await page.keyboard.press('Control+Shift+z');
      await expect.poll(changed).toEqual(both);
    }
  });
});

describe('a drag of the iso-value', () => {
  it('is one step to take back, however many values it passes', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(32, 12));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
    const line = await boxOf(page.locator('.histogram .bars'));
    await page.mouse.move(line.x + 0.5 * line.width, line.y + 30);
    await page.mouse.down();
    for (const part of [0.6, 0.75]) {
      await page.mouse.move(line.x + part * line.width, line.y + 30);
      await pause(page, 700); // longer than a step of typing
    }
    await page.mouse.up();
    await expect.poll(() => noted(page, 'iso')).not.toBe('100');
    await page.getByRole('button', { name: 'Undo' }).click();
    await expect.poll(() => noted(page, 'iso')).toBe('100');
    await expect.poll(() => page.getByRole('button', { name: 'Undo' }).isVisible()).toBe(false);
  });
});

describe('the jobs that are chosen to compare', () => {
  it('are still chosen when a person comes back from the comparison', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(32, 12));
    const ids: string[] = [];
    for (const iso of [90, 110]) ids.push((await daemon.make({ volume, iso, formats: ['glb'] })).id);
    await page.goto(`${daemon.url}/#/jobs`);
    const boxes = ids.map((id) => page.locator(`[data-job="${id}"]`).getByRole('checkbox'));
    for (const box of boxes) await box.check();
    await page.getByRole('button', { name: 'Compare' }).click();
    await page.waitForURL(/#\/compare/);
    await page.goBack();
    for (const box of boxes) await expect.poll(() => box.isChecked()).toBe(true);
  });
});

describe('a job that was left', () => {
  alone('tells when it has ended, also after the page was loaded anew', async ({ page, daemon }) => {
    await keepNotices(page);
    const volume = await daemon.upload(noiseNrrd(80));
    // The page's job waits behind one that takes long.
    const before = await daemon.submit({ volume, iso: 100, passes: 1000, max_error_mm: 0.01, formats: ['glb'] });
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=128`);
    await page.getByRole('button', { name: 'Make the surface' }).click();
    await page.waitForURL(/#\/jobs\//);
    const id = /jobs\/([^?]+)/.exec(page.url())?.[1] ?? '';
    await page.locator('.brand').click();
    await page.reload();
    await daemon.json(`/v1/jobs/${before.id}`, { method: 'DELETE' });
    const toast = page.locator('.toast', { hasText: 'iso 128' });
    await expect.poll(() => toast.innerText()).toMatch(/The surface for iso 128 is ready/);
    await toast.getByRole('link').click();
    await page.waitForURL(new RegExp(`#/jobs/${id}`));
  }, ['--workers', '1']);
});

describe('the list of volumes', () => {
  alone('is searched, sorted, and its volumes renamed', async ({ page, daemon }) => {
    for (let n = 0; n < 62; n += 1) {
      const bytes = Buffer.alloc(24, 1);
      bytes.writeUInt16LE(n + 2, 0);
      const body = new Blob([new Uint8Array(smallNrrd([], bytes))]);
      await fetch(`${daemon.url}/v1/volumes`, { method: 'POST', body, headers: { 'Content-Disposition': `attachment; filename="${n === 0 ? 'elbow' : `case ${n}`}.nrrd"` } });
    }
    await page.goto(daemon.url);
    const names = page.locator('.cards strong');
    await expect.poll(() => names.first().innerText()).toBe('case 61.nrrd');
    await expect.poll(() => names.count()).toBe(60);
    // The oldest is on no page that is there yet.
    // Letter by letter, faster than the others come.
    await page.getByLabel('Search volumes').pressSequentially('ELBOW');
    await expect.poll(() => names.allInnerTexts()).toEqual(['elbow.nrrd']);
    await expect.poll(() => page.locator('.count').innerText()).toBe('1 of 62');
    await page.locator('.card').hover();
    await page.getByRole('button', { name: 'Rename elbow.nrrd' }).click();
    await page.getByLabel('Name of this volume').and(page.locator('input')).fill('a knee');
    await page.keyboard.press('Enter');
    await expect.poll(() => page.locator('.cards').innerText()).toContain('No volume matches the search');
    await page.getByLabel('Search volumes').fill('');
    await page.getByLabel('Sort volumes').selectOption('name');
    await expect.poll(async () => (await names.allInnerTexts()).slice(0, 3)).toEqual(['a knee', 'case 1.nrrd', 'case 2.nrrd']);
  });

  alone('that is empty says what is made here, and offers a sample', async ({ page, daemon }) => {
    await page.goto(daemon.url);
    const intro = page.locator('.intro');
    await expect.poll(() => intro.innerText()).toBe('isomesh turns a CT, MRI or label volume into a 3D surface mesh.');
    await page.getByRole('button', { name: 'try a sample' }).click();
    await page.waitForURL(/#\/volumes\/[0-9a-f]{64}/);
    await expect.poll(() => page.locator('h1').first().innerText()).toContain('Sample head');
    await expect.poll(() => page.getByRole('group', { name: 'Presets' }).innerText()).toMatch(/skin[^]*bone/);
    await expect.poll(() => page.locator('.live[data-size] .live-picture[data-still]').count()).toBe(1);
    expect((await silhouette(page, page.locator('.live-picture'))).part).toBeGreaterThan(0.1);
    // With a volume the page needs no introduction.
    await page.goto(daemon.url);
    await expect.poll(() => page.locator('.cards > li a').count()).toBe(1);
    await expect.poll(() => intro.isVisible()).toBe(false);
  });
});
