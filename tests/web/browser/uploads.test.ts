// Uploads that go on, wait, ask before they send, and are dropped wherever.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, utimesSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { ctSlice, seriesNifti } from './files';
import { ballNrrd, drop, keepNotices, setup } from './support';

const { it, alone } = setup();
const volumePage = /#\/volumes\/[0-9a-f]{64}/;

// The bodies of uploads wait until they are let through.
async function held(page: Page): Promise<{ letGo: () => void; count: () => number }> {
  let open = (): void => undefined;
  const gate = new Promise<void>((resolve) => (open = resolve));
  let count = 0;
  await page.route('**/v1/volumes?*', async (route) => {
    if (route.request().method() === 'POST') {
      count += 1;
      await gate;
    }
    await route.continue();
  });
  return { letGo: () => open(), count: () => count };
}

function tarOf(files: readonly { name: string; bytes: Buffer }[]): Buffer {
  const folder = mkdtempSync(join(tmpdir(), 'isomesh-tar-'));
  try {
    for (const { name, bytes } of files) writeFileSync(join(folder, name), bytes);
    return execFileSync('tar', ['-cf', '-', '-C', folder, '.']);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

describe('an upload', () => {
  it('is taken from a drop anywhere, and the page stays where it is', async ({ page, daemon }) => {
    await keepNotices(page);
    await page.goto(`${daemon.url}/#/jobs`);
    await page.getByRole('heading', { name: 'Jobs' }).waitFor();
    const isTaken = await page.evaluate(() => {
      const transfer = new DataTransfer();
      transfer.items.add(new File(['x'], 'x.nii'));
      const event = new DragEvent('dragover', { dataTransfer: transfer, bubbles: true, cancelable: true });
      document.querySelector('main')?.dispatchEvent(event);
      return event.defaultPrevented;
    });
    expect(isTaken).toBe(true);
    await drop(page, [{ name: 'one.nrrd', bytes: ballNrrd(16, 5, 11) }], 'main');
    const link = page.locator('.toast a');
    await link.waitFor();
    expect(page.url()).toContain('#/jobs');
    await link.click();
    await page.waitForURL(volumePage);
  });

  it('goes on while other views are shown, and others wait for it', async ({ page, daemon }) => {
    await keepNotices(page);
    await page.goto(daemon.url);
    const uploads = await held(page);
    await drop(page, [{ name: 'first.nrrd', bytes: ballNrrd(16, 5, 21) }]);
    await expect.poll(() => uploads.count()).toBe(1);
    await drop(page, [{ name: 'second.nrrd', bytes: ballNrrd(16, 5, 22) }]);
    await expect.poll(() => page.locator('.upload-queue').innerText()).toContain('second.nrrd');
    await page.getByRole('link', { name: 'Jobs', exact: true }).click();
    await page.getByRole('heading', { name: 'Jobs' }).waitFor();
    await expect.poll(() => page.locator('.upload-note').innerText()).toMatch(/Uploading/);
    expect(uploads.count()).toBe(1);
    uploads.letGo();
    await expect.poll(() => page.locator('.toast').count()).toBe(2);
    expect(uploads.count()).toBe(2);
    await expect.poll(() => page.locator('.upload-note').isVisible()).toBe(false);
    await page.locator('.brand').click();
    await expect.poll(() => page.locator('[data-volume] strong', { hasText: /first|second/ }).count()).toBe(2);
  });

  it('ends where a proxy answers with its login page', async ({ page, daemon }) => {
    await page.route('**/v1/volumes?*', (route) => {
      if (route.request().method() !== 'POST') return route.continue(); // the list of volumes has the same address
      return route.fulfill({ status: 200, contentType: 'text/html', body: '<html>Log in</html>' });
    });
    await page.goto(daemon.url);
    await drop(page, [{ name: 'ball.nrrd', bytes: ballNrrd(16, 5, 31) }]);
    await expect.poll(() => page.locator('.refusal').innerText()).toContain('not one of isomeshd');
    await page.getByRole('button', { name: 'Try again' }).waitFor();
  });

  it('ends when its file changes', async ({ page, daemon }) => {
    const folder = mkdtempSync(join(tmpdir(), 'isomesh-changed-'));
    try {
      const path = join(folder, 'ball.nrrd');
      writeFileSync(path, ballNrrd(64, 20, 41));
      utimesSync(path, 1e9, 1e9); // Chromium compares times in seconds
      await page.goto(daemon.url);
      await page.route('**/v1/uploads/*', async (route) => {
        if (route.request().method() === 'PATCH') writeFileSync(path, 'changed');
        await route.continue();
      });
      await page.setInputFiles('[data-pick=files]', path);
      await expect.poll(() => page.locator('.refusal').innerText()).toContain('The file cannot be read');
    } finally {
      rmSync(folder, { recursive: true });
    }
  });

  it('of what is no volume is not sent without being asked for', async ({ page, daemon }) => {
    const sent: string[] = [];
    page.on('request', (request) => {
      if (request.method() === 'POST') sent.push(request.url());
    });
    await page.goto(daemon.url);
    const junk = Buffer.from(Array.from({ length: 4_000_000 }, (_, n) => (n * 7919) % 251));
    await drop(page, [{ name: 'junk.bin', bytes: junk }]);
    await expect.poll(() => page.locator('.refusal').innerText()).toContain('Nothing was uploaded');
    await expect.poll(() => page.getByRole('button', { name: 'Upload as raw samples' }).count()).toBe(1);
    expect(sent).toEqual([]);
    await page.getByRole('button', { name: 'Upload it anyway' }).click();
    await expect.poll(() => page.locator('.refusal').innerText()).not.toContain('Nothing was uploaded');
    expect(sent).toHaveLength(1);
  });

  it('of a series without a UID is taken from the dialog, and sent once', async ({ page, daemon }) => {
    const sent: number[] = [];
    page.on('requestfinished', (request) => {
      if (/POST|PATCH/.test(request.method())) void request.allHeaders().then((all) => sent.push(Number(all['content-length'])));
    });
    await page.goto(daemon.url);
    const slices = [1, 2, 3, 4].map((index) => ({
      name: `${index}.dcm`,
      bytes: ctSlice(index, '1.9.1', index < 3 ? 'chest' : 'none', index < 3 ? '1.2.3.4' : ''),
    }));
    await drop(page, slices);
    const chest = page.getByRole('button', { name: 'chest, CT, 2 slices' });
    await expect.poll(() => chest.innerText()).toContain('2024-05-17');
    await expect.poll(() => chest.locator('canvas').evaluate((canvas: HTMLCanvasElement) => canvas.width)).toBe(4);
    await page.getByRole('button', { name: 'none, CT, 2 slices' }).click();
    await page.waitForURL(volumePage);
    await expect.poll(() => page.locator('.facts').innerText()).toContain('4 \u00d7 4 \u00d7 2');
    const bytes = slices.reduce((sum, slice) => sum + slice.bytes.length, 0);
    // It begins, is sent, and what was chosen is read from it.
    await expect.poll(() => sent).toEqual([0, expect.any(Number), 0]);
    expect(sent[1]).toBeGreaterThan(bytes);
  });
});

describe('an upload of several volumes', () => {
  it('shows its time points on a slider before one is chosen', async ({ page, daemon }) => {
    await page.goto(daemon.url);
    const frames = Buffer.concat([1, 2, 3, 4, 5].map((bright) => Buffer.from(Array.from({ length: 12 }, (_, n) => bright * (n + 3)))));
    // In an archive, of which the page reads nothing.
    await drop(page, [{ name: 'study.tar', bytes: tarOf([{ name: 'five.nii', bytes: seriesNifti(frames) }]) }]);
    const choice = page.locator('.time-choice');
    const slider = page.getByRole('slider', { name: 'Volume of the file' });
    const brightness = (): Promise<number> =>
      choice.locator('canvas').evaluate((canvas: HTMLCanvasElement) => {
        const { data = [] } = canvas.getContext('2d')?.getImageData(0, 0, canvas.width, canvas.height) ?? {};
        return [...data].reduce((sum, value) => sum + value, 0);
      });
    await expect.poll(() => choice.innerText()).toContain('1 of 5');
    const before = await brightness();
    await slider.focus();
    for (let step = 0; step < 3; step += 1) await page.keyboard.press('ArrowRight');
    await expect.poll(() => choice.innerText()).toContain('4 of 5');
    await expect.poll(brightness).toBeGreaterThan(before);
    await page.getByRole('button', { name: 'Use this one' }).click();
    await page.waitForURL(volumePage);
    const id = /volumes\/([0-9a-f]+)/.exec(page.url())?.[1] ?? '';
    expect((await daemon.json<{ range: number[] }>(`/v1/volumes/${id}`)).range).toEqual([12, 56]);
  });

  it('shows series below their patients and studies', async ({ page, daemon }) => {
    await page.goto(daemon.url);
    const jane = { patient: 'Doe^Jane', uid: '1.5.1', title: 'Head' };
    const joe = { patient: 'Doe^Joe', uid: '1.5.2', title: 'Knee' };
    const series = [['knee', '1.6.1', joe], ['thin', '1.6.2', jane], ['thick', '1.6.3', jane]] as const;
    const slices = series.flatMap(([name, uid, study], n) =>
      [1, 2].map((index) => ({ name: `${name}${index}.dcm`, bytes: ctSlice(10 * n + index, `1.9.${n}`, name, uid, study) })),
    );
    await drop(page, slices);
    const groups = page.locator('.choice-group');
    await expect.poll(() => groups.count()).toBe(2);
    const [first, second] = await groups.allInnerTexts();
    expect(first).toMatch(/Doe Jane[^]*Head, 2024-05-17[^]*thick[^]*thin/);
    expect(first?.match(/2024-05-17/g)).toHaveLength(1);
    expect(second).toMatch(/Doe Joe[^]*Knee[^]*knee/);
    // The same as one archive, of which the page reads nothing.
    await page.goto('about:blank');
    await page.goto(daemon.url);
    await drop(page, [{ name: 'study.tar', bytes: tarOf(slices) }]);
    await expect.poll(() => groups.allInnerTexts()).toEqual([first, second]);
    const widths = await groups.locator('canvas').evaluateAll((all) => all.map((canvas) => (canvas as HTMLCanvasElement).width));
    expect(widths).toEqual([4, 4, 4]);
    await groups.nth(1).getByRole('button').click();
    await page.waitForURL(volumePage);
  });

  it('reads several series of one upload, and offers the others until a person says no', async ({ page, daemon }) => {
    const queries: string[] = [];
    page.on('request', (request) => {
      if (request.method() === 'POST' && request.url().includes('/v1/volumes')) queries.push(new URL(request.url()).search);
    });
    await page.goto(daemon.url);
    const study = { patient: 'Roe^Ann', uid: '1.7.1', title: 'Chest' };
    const slices = ['lung', 'bone', 'liver', 'scout'].flatMap((name, n) =>
      [1, 2].map((index) => ({ name: `${name}${index}.dcm`, bytes: ctSlice(100 + 10 * n + index, `1.10.${n}`, name, `1.8.${n}`, study) })),
    );
    await drop(page, slices);
    const panel = page.locator('.drop');
    await page.getByRole('heading', { name: 'Which series?' }).waitFor();
    await expect.poll(() => panel.locator('.choice canvas').count()).toBe(4);
    for (const name of ['lung', 'liver']) await panel.getByRole('checkbox', { name: `Mark ${name}` }).check();
    // At the end of the list, and seen wherever this is scrolled.
    const read = page.getByRole('button', { name: 'Read the 2 marked' });
    await panel.locator('.choices').evaluate((list) => {
      list.style.maxHeight = '120px';
      list.scrollTop = 0;
    });
    const isInList = (): Promise<boolean> => read.evaluate((own) => own.getBoundingClientRect().bottom <= (own.closest('.choices')?.getBoundingClientRect().bottom ?? 0));
    expect(await isInList()).toBe(true);
    await read.click();
    await page.getByRole('heading', { name: '2 more series are in this upload' }).waitFor();
    // Its cards are named after patient and series.
    const names = page.locator('.card strong');
    await expect.poll(async () => (await names.allInnerTexts()).filter((name) => name.startsWith('Roe Ann')).sort()).toEqual([
      'Roe Ann, liver, 2024-05-17',
      'Roe Ann, lung, 2024-05-17',
    ]);
    await expect.poll(() => panel.locator('.choices .stored a').count()).toBe(2);
    // Also after a reload, and if the server cannot be reached at first.
    const oneVolume = /\/v1\/volumes\/[0-9a-f]{64}$/;
    await page.route(oneVolume, (route) => route.abort());
    await page.reload();
    await page.locator('.toast.bad').waitFor();
    await page.unroute(oneVolume);
    for (const place of ['Jobs', 'Volumes']) await page.getByRole('link', { name: place, exact: true }).click();
    await page.getByRole('heading', { name: 'Which series?' }).waitFor();
    await expect.poll(() => panel.locator('.choices .stored a').count()).toBe(2);
    // One of the others, which is opened, and the last one is still there.
    await panel.getByRole('button', { name: 'bone' }).click();
    await page.waitForURL(volumePage);
    await page.goBack();
    await page.getByRole('heading', { name: '1 more series is in this upload' }).waitFor();
    await page.getByRole('button', { name: 'No more of these' }).click();
    await page.getByRole('heading', { name: 'Drop a volume here' }).waitFor();
    // They are found by the patient, who is also told before one is erased.
    await page.getByLabel('Search volumes').fill('roe ann');
    await expect.poll(() => names.count()).toBe(3);
    await page.getByRole('button', { name: 'Erase Roe Ann, liver' }).click();
    await expect.poll(() => page.getByRole('dialog').innerText()).toContain('Roe Ann, liver, 2024-05-17 and its samples');
    await page.keyboard.press('Escape');
    // The files were sent once.
    expect(queries.filter((query) => !query.includes('upload=')).length).toBe(1);
    expect(queries.length).toBe(5);
  });
});

describe('a refusal', () => {
  it('is brought into view where the list is scrolled, and offers no empty file again', async ({ page, daemon }) => {
    for (let seed = 60; seed < 68; seed += 1) await daemon.upload(ballNrrd(16, 5, seed));
    await page.setViewportSize({ width: 700, height: 480 });
    await page.goto(daemon.url);
    await expect.poll(() => page.locator('[data-volume]').count()).toBeGreaterThanOrEqual(8);
    const panelTop = (): Promise<number> => page.evaluate(() => document.querySelector('.drop')?.getBoundingClientRect().top ?? 0);
    await page.evaluate(() => document.querySelector('main')?.scrollTo(0, 1e6));
    expect(await panelTop()).toBeLessThan(-480);
    await drop(page, [{ name: 'empty.nii', bytes: Buffer.alloc(0) }], 'main');
    const refusal = page.getByRole('alert').filter({ hasText: 'empty.nii is empty' });
    const isInView = (): Promise<boolean> =>
      refusal.evaluate((element) => element.getBoundingClientRect().top >= 0 && element.getBoundingClientRect().bottom <= innerHeight);
    await expect.poll(isInView).toBe(true);
    expect(await page.getByRole('button', { name: 'Upload it anyway' }).count()).toBe(0);
    // A question, too, and at once for who wants no motion.
    await page.emulateMedia({ reducedMotion: 'reduce' });
    await page.evaluate(() => document.querySelector('main')?.scrollTo(0, 1e6));
    await drop(page, [{ name: 'two.nii', bytes: seriesNifti() }], 'main');
    await page.getByRole('heading', { name: 'Which volume?' }).waitFor();
    expect(await panelTop()).toBeGreaterThan(-200);
  });
});

describe('what was uploaded and refused', () => {
  it('is sent again when the daemon does not keep it any more', async ({ page, daemon }) => {
    await page.goto(daemon.url);
    await drop(page, [{ name: 'two.nii', bytes: seriesNifti() }]);
    const second = page.getByRole('list', { name: 'Which volume?' }).getByRole('button').nth(1);
    await second.waitFor();
    const statuses: number[] = [];
    page.on('response', (response) => {
      if (response.request().method() === 'POST') statuses.push(response.status());
    });
    // As an hour later.
    const gone = { status: 410, contentType: 'application/problem+json', body: JSON.stringify({ title: 'Gone', status: 410, detail: 'The upload has expired.' }) };
    await page.route('**/v1/volumes?*upload=*', (route) => route.fulfill(gone), { times: 1 });
    await second.click();
    await page.waitForURL(volumePage);
    expect(statuses).toEqual([410, 201]);
  });
});

describe('what fails for want of a connection', () => {
  alone('promises nothing that the page does not do', async ({ daemon, page }) => {
    const volume = await daemon.upload(ballNrrd(24, 8, 31));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=100`);
    await expect.poll(() => page.locator('.estimate dl').count()).toBe(1);
    await daemon.kill();
    await page.getByRole('button', { name: 'Make the surface' }).click();
    const refusal = page.locator('.panel .refusal');
    await expect.poll(() => refusal.count()).toBe(1);
    expect(await refusal.innerText()).not.toContain('automatically');
    await daemon.restart();
    await refusal.getByRole('button', { name: 'Try again' }).click();
    await page.waitForURL(/#\/jobs\//);
  });
});
