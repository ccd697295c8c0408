// Numbers that are typed key by key, with a comma where a country writes one.
import type { Locator, Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { ballNrrd, drop, noted, setup } from './support';

const { at, it } = setup({ locale: 'de-DE' });

async function type(field: Locator, text: string): Promise<void> {
  await field.focus();
  await field.press('Control+a');
  await field.press('Delete');
  await field.pressSequentially(text);
}

function run(page: Page): Locator {
  return page.getByRole('button', { name: 'Make the surface' });
}

async function openBall(): Promise<Locator> {
  const { page, daemon } = at;
  const ball = await daemon.upload(ballNrrd(24, 8));
  await page.goto(`${daemon.url}/#/volumes/${ball}?iso=100`);
  return page.locator('#iso');
}

describe('a decimal comma', () => {
  it('is one in the spacing of raw samples', async ({ page, daemon }) => {
    await page.goto(daemon.url);
    await drop(page, [{ name: 'samples.raw', bytes: ballNrrd(20, 7, 3).subarray(-8000) }]);
    const along = (what: string, axis: string): Locator => page.getByLabel(`${what} along ${axis}`);
    const submit = page.getByRole('button', { name: 'Upload as raw samples' });
    for (const axis of ['x', 'y', 'z']) await type(along('Samples', axis), '20');
    await page.getByLabel('Type').selectOption('uint8');
    for (const axis of ['x', 'y']) await type(along('Spacing in mm', axis), '0,7');
    await type(along('Spacing in mm', 'z'), '1,250');
    expect(await along('Spacing in mm', 'z').getAttribute('aria-invalid')).toBe('true');
    expect(await along('Spacing in mm', 'x').getAttribute('aria-invalid')).toBe('false');
    expect(await page.locator('.raw .warning').innerText()).toContain('can mean 1.250 or 1250');
    expect(await submit.isDisabled()).toBe(true);
    await type(along('Spacing in mm', 'z'), '1,25');
    await submit.click();
    await page.waitForURL(/#\/volumes\/[0-9a-f]{64}/);
    const id = /volumes\/([0-9a-f]+)/.exec(page.url())?.[1] ?? '';
    expect((await daemon.json<{ spacing: number[] }>(`/v1/volumes/${id}`)).spacing).toEqual([0.7, 0.7, 1.25]);
  });

  it('is one in the iso-value, and a text that is no number stays marked', async ({ page }) => {
    const iso = await openBall();
    await type(iso, '65,5');
    await iso.press('Tab');
    await expect.poll(() => noted(page, 'iso')).toBe('65.5');
    expect(await iso.inputValue()).toBe('65.5');
    await type(iso, '1.234,5');
    await iso.press('Tab');
    expect([await iso.inputValue(), await iso.getAttribute('aria-invalid')]).toEqual(['1.234,5', 'true']);
    await expect.poll(() => page.locator('.iso-row .fault').innerText()).toContain('one decimal point');
    expect(await run(page).isDisabled()).toBe(true);
    // Another kind of surface does not correct it.
    await page.getByRole('radio', { name: 'As scanned' }).check({ force: true });
    expect(await run(page).isDisabled()).toBe(true);
    await page.locator('.presets button').first().click();
    await expect.poll(() => run(page).isEnabled()).toBe(true);
    expect(await iso.getAttribute('aria-invalid')).toBe('false');
    await expect.poll(() => noted(page, 'iso')).toBe(await iso.inputValue());
    expect(await iso.inputValue()).not.toContain('1.234');
    await type(iso, '');
    await iso.press('Tab');
    await expect.poll(() => iso.inputValue()).toBe(noted(page, 'iso'));
  });
});

describe('a field for a number', () => {
  it('is stepped by the arrow keys, and read out as one', async ({ page }) => {
    const iso = await openBall();
    await expect.poll(() => page.getByRole('spinbutton', { name: 'Iso-value' }).inputValue()).toBe('100');
    await iso.focus();
    for (const key of ['ArrowUp', 'ArrowUp', 'ArrowDown']) await iso.press(key);
    await expect.poll(() => noted(page, 'iso')).toBe('101');
    expect(await iso.getAttribute('aria-valuenow')).toBe('101');
    await page.locator('.parameters summary').click();
    const lambda = page.locator('[data-parameter=lambda] input');
    await type(lambda, '0,5');
    await lambda.press('ArrowUp');
    expect([await lambda.inputValue(), await lambda.getAttribute('aria-valuemax')]).toEqual(['0.51', '1']);
    await type(lambda, '1,5');
    expect(await page.locator('[data-parameter=lambda] .fault').innerText()).toContain('at most 1');
  });

  it('of a crop keeps what is no number, and makes nothing of it', async ({ page }) => {
    await openBall();
    await page.getByLabel('Crop to a box').check();
    const last = page.getByLabel('Last sample along x');
    await type(last, '1,2,3');
    await last.press('Tab');
    expect([await last.inputValue(), await last.getAttribute('aria-invalid')]).toEqual(['1,2,3', 'true']);
    expect(await run(page).isDisabled()).toBe(true);
    await type(last, '15');
    await last.press('Tab');
    await expect.poll(() => run(page).isEnabled()).toBe(true);
    await expect.poll(() => noted(page, 'crop')).toMatch(/^(\d+,){3}15,/);
  });
});
