// The error of a surface: asked for by a slider, measured, shown in numbers and as colour.
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { titleOf } from '../openapi';
import { hues, silhouette, type Silhouette } from './seen';
import { ballNrrd, ballsNrrd, boxOf, holdMeshes, type JobAnswer, madeJob, measured, noted, openedJob, openSurface, settled, setup, still, surfaceLoaded } from './support';

const { at, it } = setup();
let ball: string;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(48, 18));
});

async function open(page: Page, path: string): Promise<void> {
  await page.goto(`${at.daemon.url}/#/${path}`);
}

async function openJob(page: Page, job: JobAnswer): Promise<void> {
  expect(job.state).toBe('succeeded');
  await open(page, `jobs/${job.id}`);
  await surfaceLoaded(page);
}

describe('the largest error', () => {
  it('is chosen by a slider, said beside the spacing and in the address, and measured', async ({ page }) => {
    await open(page, `volumes/${ball}?iso=100`);
    const slider = page.getByRole('slider', { name: titleOf('max_error_mm') });
    await expect.poll(() => slider.getAttribute('aria-valuetext')).toBe('off');
    const certify = page.getByLabel(titleOf('certify'));
    await expect.poll(() => certify.isChecked()).toBe(false);
    await slider.focus();
    await page.keyboard.press('End');
    await expect.poll(() => slider.getAttribute('aria-valuetext')).toBe('2 mm, 2 × the spacing of 1 mm');
    await slider.fill('22');
    await expect.poll(() => slider.getAttribute('aria-valuetext')).toBe('0.1 mm, 0.1 × the spacing of 1 mm');
    expect([await certify.isChecked(), await certify.isDisabled()]).toEqual([true, true]);
    await expect.poll(() => page.url()).toContain('max_error_mm=0.1');
    await page.getByRole('button', { name: 'Make the surface' }).click();
    await page.waitForURL(/#\/jobs\//);
    await surfaceLoaded(page);
    expect((await openedJob(at)).parameters).toMatchObject({ max_error_mm: 0.1, certify: true });
    const panel = page.getByLabel('Job', { exact: true });
    await expect.poll(() => panel.innerText()).toMatch(/0\.0\d+ mm is the largest distance[^]*Allowed: 0\.1 mm/);
    const text = await panel.innerText();
    expect(text).toMatch(/simplified from \d/);
    // The volume is that after smoothing and simplification.
    expect(text).toMatch(/Volume[^\n]*\n?[^\n]*mm³ as extracted/);
    expect(text).toContain('Filled: in the mesh. Line: as extracted.');
    expect(text).not.toContain('before smoothing');
    expect(text).toMatch(/The allowed 0\.1 mm are divided into: smoothing 0\.0\d+, fewer triangles 0\.0\d+, rounding/);
    expect(text).toMatch(/Self-intersections\s+none/);
    expect(text).toMatch(/simplify\s/);
    await expect.poll(() => page.locator('.both-ways td').count()).toBe(6);
    await expect.poll(() => page.locator('.distances path').count()).toBe(2);
  });
});

describe('distances', () => {
  it('are colours with a legend, and a number below the pointer', async ({ daemon, page }) => {
    const job = await daemon.make({ volume: ball, iso: 100, passes: 20, formats: ['glb'], certify: true, distances: true });
    await openJob(page, job);
    const legend = page.getByRole('group', { name: 'Distance from the scan' }).first();
    await legend.waitFor();
    await expect.poll(() => legend.innerText()).toMatch(/0\s+[\d.]+\s+[\d.]+ mm or more/);
    const view = page.locator('.viewport');
    const coloured = await silhouette(page, view);
    await legend.getByRole('radio', { name: 'Largest' }).check({ force: true });
    const largest = (await legend.locator('.legend-ends').innerText()).split(/\s+/);
    const certified = job.mesh?.certificate?.from_mesh.max_mm ?? NaN;
    expect(Number(largest.at(-2))).toBeGreaterThan(0.5 * certified);
    expect(Number(largest.at(-2))).toBeLessThan(1.1 * certified);
    await still(page);

    const box = await boxOf(view);
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await expect.poll(() => page.locator('.legend-value').innerText()).toMatch(/^[<\d. ]+ mm here$/);
    const here = parseFloat((await page.locator('.legend-value').innerText()).replace('<', ''));
    expect(here).toBeLessThanOrEqual(Number(largest.at(-2)) + 0.001);
    await page.mouse.move(box.x + 5, box.y + box.height / 2);
    await expect.poll(() => page.locator('.legend-value').innerText()).toBe('');

    await page.keyboard.press('d');
    await still(page);
    await expect.poll(() => legend.isVisible()).toBe(false);
    const plain = await hues(page, view);
    expect([plain.blue, plain.green].every((count) => count < 200)).toBe(true);
    const after = await silhouette(page, view);
    expect(after.filling).toBeCloseTo(coloured.filling, 1);
    expect(coloured.colours).toBeGreaterThan(after.colours);
  });

  it('are offered where an error was measured without them', async ({ daemon, page }) => {
    await openJob(page, await daemon.make({ volume: ball, iso: 100, passes: 3, formats: ['glb'], certify: true }));
    const ruler = await measured(page, 40);
    await page.keyboard.press('c');
    await still(page);
    const looks = (): string => ['cut', 'rulers', 'cam'].map((name) => noted(page, name)).join(' ');
    const before = await settled(page, looks);
    const address = new URL(page.url()).hash.split('?')[0];
    await page.getByRole('button', { name: 'Show the distance as colour' }).click();
    await page.locator('.legend').waitFor();
    await still(page);
    // Measured, with the way of looking as before.
    expect(new URL(page.url()).hash.split('?')[0]).toBe(address);
    await expect.poll(looks).toBe(before);
    expect(await page.locator('.ruler-labels span').innerText()).toBe(ruler);
    expect((await openedJob(at)).parameters.distances).not.toBe(true);
    // As the address says, of what was measured then.
    const made = (): Promise<{ jobs: unknown[] }> => daemon.json(`/v1/jobs?volume=${ball}`);
    const { length } = (await made()).jobs;
    await page.reload();
    await surfaceLoaded(page);
    await page.locator('.legend').waitFor();
    expect((await made()).jobs).toHaveLength(length);
  });
});

describe('a surface that is not what was meant', () => {
  it('says why it is empty and what to do', async ({ daemon, page }) => {
    const { id } = await daemon.make({ volume: ball, iso: 254.5, formats: ['glb'] });
    await open(page, `jobs/${id}`);
    const overlay = page.locator('.overlay.message');
    await expect.poll(() => overlay.innerText()).toMatch(/The surface is empty: the iso-value 254\.5 .*; its suggested iso-value is \d/);
    await overlay.getByRole('link', { name: 'Change parameters' }).click();
    await page.waitForURL(/#\/volumes\//);
  });

  it('has no volume while it is inside out, and is turned over by a link', async ({ daemon, page }) => {
    await openJob(page, await daemon.make({ volume: ball, iso: 100, inside: 'below', formats: ['glb'] }));
    const panel = page.getByLabel('Job', { exact: true });
    await expect.poll(() => panel.innerText()).toMatch(/Volume\s+none: the surface is inside out/);
    await panel.getByRole('button', { name: 'Take the bright side' }).click();
    await expect.poll(() => panel.innerText()).toMatch(/Volume\s+[\d\u202f]+ mm\u00b3/);
  });

  it('has no volume while it is open, and is closed by a link', async ({ daemon, page }) => {
    const cut = await daemon.upload(ballNrrd(24, 14));
    await openJob(page, await daemon.make({ volume: cut, iso: 100, formats: ['glb'] }));
    const panel = page.getByLabel('Job', { exact: true });
    await expect.poll(() => panel.innerText()).toMatch(/Volume\s+none: the surface is open/);
    const before = page.url();
    await panel.getByRole('button', { name: 'Close it' }).click();
    await expect.poll(() => page.url()).not.toBe(before);
    await surfaceLoaded(page);
    await expect.poll(() => panel.innerText()).toMatch(/Volume\s+[\d\u202f]+ mm\u00b3/);
    expect((await openedJob(at)).parameters).toMatchObject({ close: true });
  });

  // Of two balls, the smaller one is clicked: x grows to the patient's left, which from the front is on the right.
  const clickedPart = async (): Promise<{ told: string; seen: Silhouette }> => {
    const { daemon, page } = at;
    const two = await daemon.upload(ballsNrrd(48));
    await openJob(page, await daemon.make({ volume: two, iso: 100, formats: ['glb'], passes: 0 }));
    await page.keyboard.press('a');
    await still(page);
    const box = await boxOf(page.locator('.viewport canvas'));
    const seen = await silhouette(page, page.locator('.viewport'));
    await page.mouse.click(box.x + 4, box.y + box.height / 2);
    await expect.poll(() => page.locator('.picked-part').isVisible()).toBe(false);
    await page.mouse.click(box.x + box.width * (0.5 + 0.4 * seen.width), box.y + box.height / 2);
    await expect.poll(() => page.locator('.picked-part').innerText()).toMatch(/^One of 2 connected components: volume [\d.]+ mm³, area [\d.]+ mm², .* triangles/);
    return { told: await page.locator('.picked-part').innerText(), seen };
  };

  it('tells how large the component is that is clicked, hides it, and shows it alone', async ({ page }) => {
    const { told, seen } = await clickedPart();
    const [, volume, area] = /volume([\d.]+)mm³,area([\d.]+)mm²/.exec(told.replaceAll(/[\s\u202f]/g, '')) ?? [];
    // A ball of that radius, less what flat triangles cut off.
    const radius = 0.12 * 48;
    for (const part of [Number(volume) / ((4 / 3) * Math.PI * radius ** 3), Number(area) / (4 * Math.PI * radius ** 2)]) {
      expect(part).toBeGreaterThan(0.9);
      expect(part).toBeLessThan(1.02);
    }
    await page.getByRole('button', { name: 'Hide this component' }).click();
    await still(page);
    const larger = await silhouette(page, page.locator('.viewport'));
    expect(larger.width).toBeLessThan(0.75 * seen.width);
    await page.getByRole('button', { name: 'Show only this component' }).click();
    await still(page);
    const smaller = await silhouette(page, page.locator('.viewport'));
    expect(smaller.width).toBeLessThan(0.8 * larger.width);
  });

  it('lists its components, marks the one that is pointed at, and makes one job of those that are ticked', async ({ daemon, page }) => {
    const two = await daemon.upload(ballsNrrd(48));
    const { id } = await daemon.make({ volume: two, iso: 100, formats: ['glb'], passes: 0 });
    await openSurface(at, id);
    await page.getByText('2 connected components').click();
    const rows = page.locator('.components li');
    await expect.poll(() => rows.count()).toBe(2);
    await expect.poll(() => rows.last().innerText()).toMatch(/^volume [\d.\u202f]+ mm³, area [\d.\u202f]+ mm², [\d\u202f]+ triangles; at [-\d., ]+ mm$/);
    const orange = async (): Promise<number> => {
      await still(page);
      return (await hues(page, page.locator('.viewport'))).red;
    };
    expect(await orange()).toBe(0);
    await rows.last().hover();
    await expect.poll(orange).toBeGreaterThan(300);
    await page.mouse.move(5, 5);
    await expect.poll(orange).toBe(0);
    const make = page.getByRole('button', { name: 'Make what is shown' });
    expect(await make.isDisabled()).toBe(true);
    await rows.last().getByRole('checkbox').uncheck();
    await rows.first().getByRole('checkbox').uncheck();
    await expect.poll(() => page.locator('.components').innerText()).toContain('0 of 2 are shown');
    await rows.last().getByRole('checkbox').check();
    await make.click();
    await expect.poll(() => page.url()).not.toContain(id);
    const { mesh } = await madeJob(at);
    expect(mesh?.components).toBe(1);
    expect(mesh?.bounds[0][0]).toBeGreaterThan(24);
  });
});

describe('levels of detail', () => {
  it('show the whole surface before its finest level has come', async ({ daemon, page }) => {
    const job = await daemon.make({ volume: ball, iso: 100, formats: ['glb'], lods: [1, 0.1] });
    const release = await holdMeshes(page);
    await open(page, `jobs/${job.id}`);
    const filling = async (): Promise<number> => {
      // The bar of the progress is in the same view.
      await page.evaluate(() => {
        for (const load of document.querySelectorAll<HTMLElement>('.load')) load.style.visibility = 'hidden';
      });
      return (await silhouette(page, page.locator('.viewport'))).filling;
    };
    await expect.poll(filling).toBeGreaterThan(Math.PI / 4 - 0.06);
    await expect.poll(() => page.locator('.pane[data-loaded]').count()).toBe(0);
    release();
    await surfaceLoaded(page);
    await expect.poll(filling).toBeGreaterThan(Math.PI / 4 - 0.03);
  });
});
