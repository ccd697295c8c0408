// A surface on one sheet, and the list of jobs as a place to find and to clear.
import { readFileSync } from 'node:fs';
import { describe, expect } from 'vitest';
import { ballNrrd, labelsNrrd, noted, openSurface, setup } from './support';

const { it, alone } = setup();

describe('a report', () => {
  it('has pictures, numbers, the proof, versions and hashes on a sheet, and as JSON', async (at) => {
    const { page, daemon } = at;
    const scan = await daemon.upload(ballNrrd(24, 8));
    const { id: volume } = await daemon.json<{ id: string }>(`/v1/volumes/${scan}/reoriented?axes=-x,y,z`, { method: 'POST' });
    const job = await daemon.make({ volume, iso: 100, formats: ['glb', 'stl', '3mf'], certify: true });
    await openSurface(at, job.id);
    await page.getByRole('button', { name: 'Report' }).click();
    await page.waitForURL(/#\/jobs\/[^/]+\/report/);
    const sheet = page.locator('.report');
    await expect.poll(() => sheet.locator('img').count()).toBe(4);
    const widths = await sheet.locator('img').evaluateAll((all) => all.map((image) => (image as HTMLImageElement).naturalWidth));
    expect(Math.min(...widths)).toBeGreaterThan(100);
    const text = await sheet.innerText();
    for (const { sha256 } of Object.values(job.mesh?.files ?? {})) expect(text).toContain(sha256);
    expect(text).toMatch(/Volume[^]*mm\u00b3[^]*Connected components[^]*Distance from the scan[^]*Parameters/);
    expect(text).toMatch(/Notes[^]*-x,y,z[^]*Made\s+\d+ \w+ 20\d\d[^]*Before you print[^]*Closed: it has an inside/);
    expect(await sheet.locator('.print-check button').count()).toBe(0);
    expect(text).toContain((await daemon.json<{ version: string }>('/version')).version);
    const [saved] = await Promise.all([page.waitForEvent('download'), page.getByRole('button', { name: 'Save as JSON' }).click()]);
    const told = JSON.parse(readFileSync(await saved.path(), 'utf8')) as { job: { id: string }; volume: { id: string } };
    expect([told.job.id, told.volume.id]).toEqual([job.id, volume]);
    await page.emulateMedia({ media: 'print' });
    expect(await page.locator('header.top').isVisible()).toBe(false);
    // Without pictures it is told where they are, but not on paper.
    await page.reload();
    const hint = sheet.getByText('Choose Report beside the surface');
    await hint.waitFor({ state: 'attached' });
    expect(await hint.isVisible()).toBe(false);
  });
});

describe('the list of jobs', () => {
  alone('is filtered, searched and sorted, leads from a volume to all of its surfaces, and is cleared', async ({ page, daemon }) => {
    const [ball, other] = [await daemon.upload(ballNrrd(16, 5)), await daemon.upload(ballNrrd(16, 6, 2))];
    for (const iso of [90, 95, 100, 105]) await daemon.make({ volume: ball, iso, formats: ['stl'] });
    await daemon.make({ volume: other, iso: 91, formats: ['stl'] });
    await page.goto(`${daemon.url}/#/volumes/${ball}`);
    await page.getByRole('link', { name: 'All of them' }).click();
    const rows = page.locator('[data-job]');
    await expect.poll(() => rows.count()).toBe(4);
    await page.getByRole('link', { name: 'Jobs of all volumes' }).click();
    await expect.poll(() => rows.count()).toBe(5);
    await page.getByRole('searchbox').fill('iso 91');
    await expect.poll(() => rows.count()).toBe(1);
    await expect.poll(() => noted(page, 'search')).toBe('iso 91');
    const id = await rows.first().getAttribute('data-job');
    await page.getByRole('searchbox').fill(id?.slice(-8) ?? '');
    await expect.poll(() => rows.count()).toBe(1);
    await page.getByRole('searchbox').fill('');
    await page.getByLabel('State').selectOption('failed');
    await expect.poll(() => rows.count()).toBe(0);
    await page.getByLabel('State').selectOption('');
    await page.getByLabel('Order').selectOption('oldest');
    await expect.poll(() => rows.first().innerText()).toContain('iso 90');
    await page.getByLabel('To', { exact: true }).fill('2001-01-01');
    await expect.poll(() => rows.count()).toBe(0);
    await page.getByLabel('To', { exact: true }).fill('');
    await expect.poll(() => rows.count()).toBe(5);
    for (const at of [0, 2]) await rows.nth(at).getByRole('checkbox').check();
    // A search hides them from being erased, too.
    await page.getByRole('searchbox').fill('iso 91');
    const erase = page.locator('.section-head button.danger');
    await expect.poll(() => erase.isDisabled()).toBe(true);
    await page.getByRole('button', { name: 'Choose all' }).click();
    await expect.poll(() => erase.innerText()).toBe('Erase (1)');
    await page.getByRole('button', { name: 'Choose all' }).click();
    await page.getByRole('searchbox').fill('');
    await page.getByRole('button', { name: 'Erase (2)' }).click();
    await page.getByRole('dialog').getByRole('button', { name: 'Erase' }).click();
    await expect.poll(() => rows.count()).toBe(3);
    expect((await daemon.json<{ jobs: unknown[] }>('/v1/jobs')).jobs).toHaveLength(3);
  });
});

describe('a label of a list', () => {
  it('is where the slices go, before and beside the surface', async (at) => {
    const { page, daemon } = at;
    const volume = await daemon.upload(labelsNrrd(24, ['Segment0_LabelValue:=5', 'Segment0_ID:=s', 'Segment0_Name:=block']));
    await page.goto(`${daemon.url}/#/volumes/${volume}?labels=all`);
    await page.getByRole('button', { name: /^Show (block|label 5) in the slices/ }).click();
    await expect.poll(() => noted(page, 'at')).toMatch(/,2[01]$/);
    const job = await daemon.make({ volume, labels: 'all', formats: ['glb'] });
    await openSurface(at, `${job.id}?slices=on`);
    await page.getByRole('button', { name: /^Show only (block|label 5)/ }).click();
    await expect.poll(() => noted(page, 'at')).toMatch(/,2[01]$/);
    await page.getByRole('button', { name: 'Make what is shown' }).click();
    await expect.poll(() => page.locator('.panel-head h1').innerText()).toMatch(/^Surfaces of (block|label 5)$/);
  });
});
