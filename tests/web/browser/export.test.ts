// What a surface is saved as for a printer and for a phone.
import { readFileSync } from 'node:fs';
import type { Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { pixelsOf } from './seen';
import { ballNrrd, ballsNrrd, madeJob, noiseNrrd, openSurface, setup, surfaceLoaded } from './support';

const { at, it } = setup();

async function saved(page: Page, name: RegExp): Promise<{ name: string; bytes: Buffer }> {
  const download = page.waitForEvent('download');
  await page.getByRole('button', { name }).click();
  const file = await download;
  return { name: file.suggestedFilename(), bytes: readFileSync(await file.path()) };
}

describe('a surface', () => {
  it('is made for printing, with its certificate', async ({ page, daemon }) => {
    // It leaves the volume on all sides.
    const volume = await daemon.upload(ballNrrd(24, 14));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await page.getByRole('button', { name: 'For 3D printing' }).click();
    await expect.poll(() => page.url()).not.toContain(id);
    await expect.poll(() => page.locator('[data-format="3mf"]').count()).toBe(1);
    await expect.poll(() => page.locator('[data-format=stl]').count()).toBe(1);
    await expect.poll(() => page.getByRole('button', { name: 'For 3D printing' }).count()).toBe(0);
    const made = await madeJob(at);
    expect(made.parameters).toMatchObject({ close: true, certify: true, min_thickness_mm: 0.4, fill_cavities: true, smoothing: 'taubin', max_error_mm: 0.2, components: { keep: 1 } });
    const { name, bytes } = await saved(page, /^Certificate$/);
    expect(name).toMatch(/\.report\.json$/);
    const { job } = JSON.parse(bytes.toString()) as { job: typeof made };
    expect(job.mesh?.certificate?.found_mm).toBe(made.mesh?.certificate?.found_mm);
    expect(job.mesh?.files['3mf']?.sha256).toBe(made.mesh?.files['3mf']?.sha256);
  });

  it('for printing is one closed component, and says in plain words that it is ready', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballsNrrd(40));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
    await page.getByRole('radio', { name: 'For printing', exact: true }).check({ force: true });
    await page.getByRole('button', { name: 'Make the surface' }).click();
    const points = page.locator('.print-check li');
    await expect.poll(() => points.count()).toBe(7);
    const made = await madeJob(at);
    expect(made.mesh?.components).toBe(1);
    expect(made.mesh?.certificate).toMatchObject({ proven: true });
    await expect.poll(() => page.locator('.print-check [data-state=good]').count()).toBe(5);
    expect(await page.locator('.print-check [data-state=bad]').count()).toBe(0);
    const text = await page.locator('.print-check').innerText();
    expect(text).toMatch(/One connected component/);
    expect(text).toMatch(/Nowhere more than 0\.\d+ mm from the scan. This is proven/);
    expect(text).toMatch(/Thinnest wall: [\d.]+ mm at .*, no less than the nozzle's 0\.4 mm/);
    expect(text).toMatch(/STL [\d.]+ KB/);
    expect(text).not.toMatch(/max_error_mm|certif/i);
  });

  it('for printing that is not ready names what is wrong, shows where, and offers what helps', async ({ page, daemon }) => {
    const volume = await daemon.upload(noiseNrrd(20));
    const { id, mesh } = await daemon.make({ volume, iso: 128, passes: 60, certify: true, min_thickness_mm: 0.9, formats: ['glb', 'stl', '3mf'] });
    expect(mesh?.components).toBeGreaterThan(1);
    await openSurface(at, id);
    const bad = page.locator('.print-check [data-state=bad]');
    await expect.poll(() => bad.count()).toBe(4);
    const text = await page.locator('.print-check').innerText();
    expect(text).toMatch(/Open at .* edges/);
    expect(text).toMatch(/Walls below the nozzle's 0\.9 mm: [\d.]+ mm\u00b2 of the surface \([\d.]+ %\)\. The thinnest is [\d.]+ mm at/);
    await bad.getByRole('button', { name: 'Show it' }).click();
    await expect.poll(() => page.locator('.pane').getAttribute('data-marks')).toBe('1');
    await bad.getByRole('button', { name: 'Show them' }).click();
    await expect.poll(() => page.locator('.pane').getAttribute('data-marks')).toMatch(/^[1-9]/);
    const red = async (): Promise<number> => {
      const pixels = await pixelsOf(page, await page.locator('.viewport').screenshot());
      return page.evaluate(({ data }) => {
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if ((data[i] ?? 0) > 200 && (data[i + 1] ?? 0) < 110 && (data[i + 2] ?? 0) < 120) count += 1;
        return count;
      }, pixels);
    };
    await expect.poll(red).toBeGreaterThan(40);
    await bad.getByRole('button', { name: 'Untangle them' }).click();
    await expect.poll(() => page.url()).not.toContain(id);
    await surfaceLoaded(page);
    expect((await madeJob(at)).parameters).toMatchObject({ passes: 60, untangle: true });
    await expect.poll(() => page.locator('.print-check').innerText()).toMatch(/No triangle crosses another one/);
  });

  it('is saved for a phone, and simplified first where it is large', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(32, 10));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await openSurface(at, id);
    const { name, bytes } = await saved(page, /^USDZ for/);
    expect(name).toMatch(/iso-100\.usdz$/);
    // A ZIP whose files are stored as they are.
    expect(bytes.subarray(0, 4).toString('latin1')).toBe('PK\u0003\u0004');
    expect(bytes.includes('#usda 1.0')).toBe(true);
    expect(bytes.includes('upAxis = "Y"')).toBe(true);

    const large = await daemon.upload(ballNrrd(180, 85));
    const job = await daemon.make({ volume: large, iso: 100, formats: ['glb'] });
    expect(job.mesh?.triangles).toBeGreaterThan(150_000);
    await page.goto(`${daemon.url}/#/jobs/${job.id}`);
    const posted = page.waitForResponse((response) => response.request().method() === 'POST' && response.url().endsWith('/v1/jobs'));
    expect((await saved(page, /^USDZ for/)).bytes.includes('#usda 1.0')).toBe(true);
    const { id: made } = (await (await posted).json()) as { id: string };
    expect((await daemon.json<{ mesh: { triangles: number } }>(`/v1/jobs/${made}`)).mesh.triangles).toBeLessThanOrEqual(150_000);
  });
});
