// What a person erases goes: surfaces by themselves, and with their volume.
import type { Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { ballNrrd, openSurface, setup } from './support';

const { at, it } = setup();

// What is asked to be erased, which the test answers: so the server's own tests alone say what goes with it.
async function erasedOf(page: Page): Promise<string[]> {
  const erased: string[] = [];
  await page.route(/\/v1\/(jobs|volumes)\/[^/]+$|\?jobs=/, async (route) => {
    if (route.request().method() !== 'DELETE') return route.fallback();
    const { pathname, search } = new URL(route.request().url());
    erased.push(pathname + search);
    return route.fulfill({ status: 204 });
  });
  return erased;
}

describe('a surface', () => {
  it('is erased on its own page and in the list of jobs, if the person agrees', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(16, 5, 11));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    const erased = await erasedOf(page);
    await openSurface(at, id);
    const agree = page.getByRole('dialog').getByRole('button', { name: 'Erase' });
    await page.locator('.panel-head').getByRole('button', { name: 'Erase' }).click();
    await page.getByRole('dialog').getByRole('button', { name: 'Cancel' }).click();
    expect(erased).toEqual([]);
    await page.locator('.panel-head').getByRole('button', { name: 'Erase' }).click();
    await agree.click();
    await page.waitForURL(/#\/jobs$/);
    expect(erased).toEqual([`/v1/jobs/${id}`]);
    const row = page.locator(`[data-job="${id}"]`);
    await row.getByRole('button', { name: /^Erase/ }).click();
    await agree.click();
    await expect.poll(() => erased.length).toBe(2);
    await page.getByText('The surface was erased.').last().waitFor();
  });
});

describe('a volume', () => {
  it('is erased with the surfaces that were made from it, or without', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(16, 5, 12));
    const erased = await erasedOf(page);
    await page.goto(daemon.url);
    const dialog = page.getByRole('dialog');
    for (const isWithJobs of [false, true]) {
      await page.locator(`[data-volume="${volume}"]`).getByRole('button', { name: /^Erase/ }).click();
      if (isWithJobs) await dialog.getByRole('checkbox', { name: 'Also erase the surfaces' }).check();
      await dialog.getByRole('button', { name: 'Erase', exact: true }).click();
      await expect.poll(() => dialog.count()).toBe(0);
    }
    await expect.poll(() => erased).toEqual([`/v1/volumes/${volume}`, `/v1/volumes/${volume}?jobs=erase`]);
  });
});
