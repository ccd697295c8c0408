// Several surfaces in one scene.
import { describe, expect } from 'vitest';
import { hues, silhouette } from './seen';
import { ballNrrd, labelsNrrd, noted, settled, setup, surfaceLoaded } from './support';

const { it } = setup();

describe('surfaces in one scene', () => {
  it('have colours and opacities of their own, are hidden, and come back by the address', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const jobs = [];
    for (const iso of [70, 200]) jobs.push(await daemon.make({ volume, iso, formats: ['glb'] }));
    await page.goto(`${daemon.url}/#/jobs`);
    const boxes = page.getByRole('checkbox', { name: /^Choose/ });
    await expect.poll(() => boxes.count()).toBe(2);
    for (const box of await boxes.all()) await box.check();
    await page.getByRole('button', { name: 'Show in one scene' }).click();
    await page.waitForURL(/#\/together/);
    await surfaceLoaded(page);
    const view = page.locator('.viewport');
    const large = page.locator(`li[data-job="${jobs[0]?.id ?? ''}"]`);
    const small = page.locator(`li[data-job="${jobs[1]?.id ?? ''}"]`);
    await large.getByLabel(/^Colour/).fill('#2040d0');
    await small.getByLabel(/^Colour/).fill('#d02020');
    await surfaceLoaded(page);
    const outer = await hues(page, view);
    // The small one is within the large one.
    expect(outer.blue).toBeGreaterThan(5000);
    expect(outer.red).toBe(0);
    await large.getByLabel(/^Opacity/).fill('0.3');
    await surfaceLoaded(page);
    await expect.poll(async () => (await hues(page, view)).red).toBeGreaterThan(1000);
    const whole = (await silhouette(page, view)).part;
    await large.getByRole('checkbox').uncheck();
    await surfaceLoaded(page);
    expect((await silhouette(page, view)).part).toBeLessThan(0.6 * whole);
    expect((await settled(page, () => noted(page, 'looks'))).split(',').sort()).toEqual(['2040d0.30-', 'd02020.100']);
    await page.reload();
    await surfaceLoaded(page);
    expect((await silhouette(page, view)).part).toBeLessThan(0.6 * whole);
    expect((await hues(page, view)).red).toBeGreaterThan(1000);
    await large.getByRole('link', { name: 'open' }).click();
    await page.waitForURL(new RegExp(`#/jobs/${jobs[0]?.id ?? ''}`));
  });

  it('show each label of a job in its own colour until they get one together', async ({ page, daemon }) => {
    const volume = await daemon.upload(labelsNrrd(32));
    const job = await daemon.make({ volume, labels: 'all', label_colors: { 1: '#d02020', 2: '#2040e0' }, formats: ['glb'] });
    await page.goto(`${daemon.url}/#/together?jobs=${job.id}`);
    await surfaceLoaded(page);
    const view = page.locator('.viewport');
    const own = await hues(page, view);
    expect(own.red).toBeGreaterThan(1000);
    expect(own.blue).toBeGreaterThan(1000);
    await page.getByRole('checkbox', { name: 'colours of its labels' }).uncheck();
    await page.getByLabel(/^Colour/).fill('#2040e0');
    await surfaceLoaded(page);
    await expect.poll(async () => (await hues(page, view)).red).toBe(0);
    await page.getByRole('checkbox', { name: 'colours of its labels' }).check();
    await expect.poll(async () => (await hues(page, view)).red).toBeGreaterThan(1000);
  });

  it('have to be some', async ({ page, daemon }) => {
    await page.goto(`${daemon.url}/#/together`);
    await expect.poll(() => page.locator('.refusal').innerText()).toMatch(/No surfaces to show/);
  });
});
