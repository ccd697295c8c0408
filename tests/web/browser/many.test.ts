// Many volumes and many jobs, and what others do meanwhile.
import { beforeAll, describe, expect } from 'vitest';
import { ballNrrd, noiseNrrd, setup } from './support';
import { smallNrrd } from './files';

const { at, it } = setup();
const many = 130;
let first: string;

beforeAll(async () => {
  for (let n = 0; n < many; n += 1) {
    const bytes = Buffer.alloc(24, 1);
    bytes.writeUInt16LE(n + 2, 0);
    const id = await at.daemon.upload(smallNrrd([], bytes));
    if (n === 0) first = id;
  }
});

describe('the first view', () => {
  it('shows the newest of many volumes, and the others when they are asked for', async ({ page, daemon }) => {
    await daemon.make({ volume: first, iso: 1.5, formats: ['stl'] });
    const newest = await daemon.upload(ballNrrd(12, 4, 5));
    await page.goto(daemon.url);
    await expect.poll(() => page.locator('.cards > li').first().getAttribute('data-volume')).toBe(newest);
    await expect.poll(() => page.locator(`[data-volume="${first}"]`).count()).toBe(0);
    // A surface of a volume that is not among them has its name all the same.
    expect(await page.locator('.rows').innerText()).not.toContain('erased');
    for (let page_ = 0; page_ < 2; page_ += 1) await page.getByRole('button', { name: 'Older volumes' }).click();
    await expect.poll(() => page.locator('.cards > li').count()).toBe(many + 1);
    await expect.poll(() => page.getByRole('button', { name: 'Older volumes' }).isVisible()).toBe(false);
    await expect.poll(() => page.locator('.cards > li').last().getAttribute('data-volume')).toBe(first);
    await page.goto(`${daemon.url}/#/jobs`);
    await page.locator('table.jobs').waitFor();
    expect(await page.locator('table.jobs').innerText()).not.toContain('erased');
  });

  it('shows what others do, and keeps what a person is at', async ({ page, daemon }) => {
    await page.goto(daemon.url);
    const link = page.locator('.cards > li a').first();
    await link.waitFor();
    await link.focus();
    const focused = await page.evaluate(() => document.activeElement?.closest('li')?.dataset.volume);
    const volume = await daemon.upload(ballNrrd(12, 4, 6));
    await expect.poll(() => page.locator(`[data-volume="${volume}"]`).count()).toBe(1);
    await daemon.make({ volume, iso: 100, formats: ['stl'] });
    await expect.poll(() => page.locator('.rows li').first().innerText()).toMatch(/iso 100.*triangles/s);
    expect(await page.evaluate(() => document.activeElement?.closest('li')?.dataset.volume)).toBe(focused);
  });
});

describe('jobs that are waited for', () => {
  it('are told of by one stream, and nothing else has to wait', async ({ page, daemon }) => {
    const streams: string[] = [];
    page.on('request', (request) => {
      if (request.url().includes('/events')) streams.push(new URL(request.url()).pathname);
    });
    const volume = await daemon.upload(noiseNrrd(96));
    const jobs = await Promise.all(
      [1000, 999, 998, 997].map((passes) => daemon.submit({ volume, iso: 128, passes, max_error_mm: 0.01, formats: ['glb'] })),
    );
    await page.goto(`${daemon.url}/#/compare?jobs=${jobs.map(({ id }) => id).join(',')}`);
    await expect.poll(() => page.locator('.cell-status', { hasText: '%' }).count()).toBe(4);
    for (const { id } of jobs) await daemon.json(`/v1/jobs/${id}`, { method: 'DELETE' });
    await expect.poll(() => page.locator('.cell .refusal', { hasText: 'Cancelled' }).count()).toBe(4);
    expect(streams).toEqual(['/v1/events']);
    // Nobody listens any more.
    await page.goto(`${daemon.url}/#/volumes/${first}`);
    await page.locator('.prepare').waitFor();
    // All of the many volumes can be laid over this one, once somebody is about to choose.
    const overlay = page.getByLabel('Overlay', { exact: true });
    await overlay.waitFor();
    await overlay.focus();
    const { volumes } = await daemon.json<{ volumes: { id: string }[] }>('/v1/volumes?limit=1000');
    expect(volumes.length).toBeGreaterThan(many);
    const values = (): Promise<string[]> => overlay.locator('option').evaluateAll((options) => options.map((option) => (option as HTMLOptionElement).value).sort());
    const others = volumes.map(({ id }) => id).filter((id) => id !== first);
    await expect.poll(async () => (await values()).length).toBe(1 + others.length);
    expect(await values()).toEqual(['', ...others].sort());
  });
});
