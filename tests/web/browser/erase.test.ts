// What a person erases goes: surfaces by themselves, and with their volume.
import { describe, expect } from 'vitest';
import { ballNrrd, openSurface, setup } from './support';

const { at, it } = setup();

const statusOf = async (url: string, path: string): Promise<number> => (await fetch(new URL(path, url))).status;

describe('a surface', () => {
  it('is erased on its own page and in the list of jobs, if the person agrees', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(16, 5, 11));
    const first = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    const second = await daemon.make({ volume, iso: 90, formats: ['glb'] });
    await openSurface(at, first.id);
    const agree = page.getByRole('dialog').getByRole('button', { name: 'Erase' });
    await page.locator('.panel-head').getByRole('button', { name: 'Erase' }).click();
    await page.getByRole('dialog').getByRole('button', { name: 'Cancel' }).click();
    expect(await statusOf(daemon.url, `/v1/jobs/${first.id}`)).toBe(200);
    const places = await page.evaluate(() => history.length);
    await page.locator('.panel-head').getByRole('button', { name: 'Erase' }).click();
    await agree.click();
    await page.waitForURL(/#\/jobs$/);
    // Back does not lead to what is gone.
    expect(await page.evaluate(() => history.length)).toBe(places);
    expect(await statusOf(daemon.url, `/v1/jobs/${first.id}`)).toBe(404);
    const row = page.locator(`[data-job="${second.id}"]`);
    await row.getByRole('button', { name: /^Erase/ }).click();
    await agree.click();
    await expect.poll(() => row.count()).toBe(0);
    expect(await page.locator(`[data-job="${first.id}"]`).count()).toBe(0);
    expect(await statusOf(daemon.url, `/v1/jobs/${second.id}`)).toBe(404);
    expect(await statusOf(daemon.url, `/v1/volumes/${volume}`)).toBe(200);
  });
});

describe('a volume', () => {
  it('is erased with the surfaces that were made from it, or without', async ({ page, daemon }) => {
    const dialog = page.getByRole('dialog');
    for (const isWithJobs of [false, true]) {
      const volume = await daemon.upload(ballNrrd(16, 5, isWithJobs ? 13 : 12));
      const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
      await page.goto(daemon.url);
      await page.reload();
      await page.locator(`[data-volume="${volume}"]`).getByRole('button', { name: /^Erase/ }).click();
      if (isWithJobs) await dialog.getByRole('checkbox', { name: 'Also erase the surfaces' }).check();
      await dialog.getByRole('button', { name: 'Erase', exact: true }).click();
      await expect.poll(() => statusOf(daemon.url, `/v1/volumes/${volume}`)).toBe(404);
      expect(await statusOf(daemon.url, `/v1/jobs/${id}`)).toBe(isWithJobs ? 404 : 200);
    }
  });
});

describe('a volume whose record is damaged', () => {
  it('hides neither the other volumes nor the jobs and the surface that were made from it', async ({ page, daemon }) => {
    const [volume, other] = [await daemon.upload(ballNrrd(16, 5, 14)), await daemon.upload(ballNrrd(16, 5, 15))];
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    const problem = { title: 'Internal error', status: 500, detail: 'The service failed on this request; its log has the reason.' };
    await page.route(`**/v1/volumes/${volume}`, (route) => route.fulfill({ status: 500, contentType: 'application/problem+json', body: JSON.stringify(problem) }));
    await page.goto(daemon.url);
    await page.locator(`[data-volume="${other}"]`).waitFor();
    await page.goto(`${daemon.url}/#/jobs`);
    const row = page.locator(`[data-job="${id}"]`);
    await expect.poll(() => row.innerText()).toContain('unreadable volume');
    await row.getByRole('link').click();
    await expect.poll(() => page.locator('.of-volume').innerText()).toBe('unreadable volume');
    await page.locator('.pane[data-loaded]').waitFor();
  });
});
