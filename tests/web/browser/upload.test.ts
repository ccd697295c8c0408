// What comes in: several files, refused ones, and those of people with a token.
import { readFileSync } from 'node:fs';
import { describe, expect } from 'vitest';
import { ballNrrd, brain, cubeNrrd, setup, drop, openPage, surfaceLoaded, withTokens } from './support';

const { it } = setup();

describe('several files', () => {
  it('are packed in the browser and come as one volume', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    const header = [
      'ObjectType = Image',
      'NDims = 3',
      'DimSize = 20 20 20',
      'ElementSpacing = 1 1 2',
      'ElementType = MET_UCHAR',
      'ElementDataFile = ball.raw',
      '',
    ].join('\n');
    await drop(page, [
      { name: 'ball.mhd', bytes: Buffer.from(header) },
      { name: 'ball.raw', bytes: ballNrrd(20, 7).subarray(-8000) },
    ]);
    await page.waitForURL(/#\/volumes\/[0-9a-f]{64}/);
    await expect.poll(() => page.locator('.facts').innerText()).toMatch(/MetaImage.*20 \u00d7 20 \u00d7 20.*1 \u00d7 1 \u00d7 2 mm/);
  });

  it('that are masks become one volume with a name for each, if a person says so', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    const mask = (from: number): Buffer => cubeNrrd(12, (x, y, z) => Number(x >= from && x < from + 4 && y > 2 && y < 8 && z > 2 && z < 8));
    await drop(page, [
      { name: 'liver.nrrd', bytes: mask(1) },
      { name: 'spleen.nrrd', bytes: mask(7) },
    ]);
    await expect.poll(() => page.locator('.drop').innerText()).toContain('2 of 2 volumes in the upload were stored');
    await page.getByRole('button', { name: 'One surface each, together' }).click();
    await page.waitForURL(/#\/volumes\/[0-9a-f]{64}/);
    const id = /[0-9a-f]{64}/.exec(page.url())?.[0] ?? '';
    const { labels } = await daemon.json<{ labels: { name: string; voxels: number }[] }>(`/v1/volumes/${id}/labels?background=0`);
    expect(labels.map(({ name, voxels }) => [name, voxels])).toEqual([['liver', 100], ['spleen', 100]]);
  });

  it('of more than one series let a person choose', async ({ daemon, page }) => {
    // The daemon's own tests hold real series; here it matters what the page does with the refusal.
    const asked: string[] = [];
    const choices = {
      series: [
        { parameter: 'series', value: '1.2.840.1', title: 'head, 93 slices' },
        { parameter: 'series', value: '1.2.840.2', title: 'chest, 40 slices' },
      ],
      spacing: [{ parameter: 'spacing', value: '1,1,1', title: '1 mm in all directions' }],
    };
    await page.route('**/v1/volumes*', async (route) => {
      const url = new URL(route.request().url());
      if (route.request().method() !== 'POST') return route.continue();
      const [series, spacing] = ['series', 'spacing'].map((name) => url.searchParams.get(name));
      asked.push([series, spacing].filter(Boolean).join(' '));
      if (spacing === '1,1,1') return route.continue({ url: `${daemon.url}/v1/volumes` });
      // The first series is damaged, and the server likes no distances but one.
      const open = series === null ? { choices: choices.series } : series === '1.2.840.2' && spacing === null ? { choices: choices.spacing } : {};
      return route.fulfill({
        status: 422,
        contentType: 'application/problem+json',
        body: JSON.stringify({
          type: 'urn:isomesh:problem:unusable-volume',
          title: 'Unusable volume',
          status: 422,
          detail: `the upload cannot be used with ${asked.at(-1)}`,
          ...open,
        }),
      });
    });
    await page.goto(daemon.url);
    await drop(page, [{ name: 'study.nrrd', bytes: ballNrrd(16, 5, 3) }]);
    await page.getByRole('heading', { name: 'Which series?' }).waitFor();
    // It is a question and no error, in words that are no names of parameters.
    const refusal = page.locator('.drop .refusal');
    expect(await refusal.count()).toBe(0);
    expect(await page.locator('.drop').innerText()).not.toMatch(/series=|1\.2\.840/);
    // An answer that fails leaves the question open.
    await page.getByRole('button', { name: 'head, 93 slices' }).click();
    await expect.poll(() => refusal.innerText()).toContain('cannot be used with 1.2.840.1');
    expect(await page.getByRole('list', { name: 'Which series?' }).getByRole('button').count()).toBe(2);
    await page.getByRole('button', { name: 'chest, 40 slices' }).click();
    await page.getByRole('heading', { name: 'Which distance between samples?' }).waitFor();
    const own = page.getByLabel('Millimetres along x, y and z', { exact: true });
    await own.fill('0.5 0.5');
    await own.press('Enter');
    expect(await page.locator('.drop .fault').innerText()).toContain('three numbers');
    await own.fill('0.5 x 0,5 x 2');
    await own.press('Enter');
    await expect.poll(() => refusal.innerText()).toContain('cannot be used with 1.2.840.2 0.5,0.5,2');
    expect(await own.inputValue()).toBe('0.5,0.5,2');
    await page.getByRole('button', { name: '1 mm in all directions' }).click();
    await page.waitForURL(/#\/volumes\/[0-9a-f]{64}/);
    expect(asked).toEqual(['', '1.2.840.1', '1.2.840.2', '1.2.840.2 0.5,0.5,2', '1.2.840.2 1,1,1']);
  });
});

describe('a server with tokens', () => {
  it('is entered with one, and with none but one', async ({ browser }) => {
    await withTokens(async (guarded, token) => {
      const { page: mine, faults: none } = await openPage(browser, guarded.url);
      await mine.goto(guarded.url);
      const field = mine.getByLabel('Token', { exact: true }).and(mine.locator('input'));
      await field.fill('wrong');
      await mine.getByRole('button', { name: 'Continue' }).click();
      await expect.poll(() => mine.locator('dialog').innerText()).toMatch(/does not accept the token/);
      await field.fill(token);
      await mine.getByRole('button', { name: 'Continue' }).click();
      await expect.poll(() => mine.getByRole('button', { name: 'Choose files' }).isVisible()).toBe(true);

      // Slices, meshes and downloads go with it too.
      await mine.setInputFiles('[data-pick=files]', { name: 'ball.nrrd', mimeType: '', buffer: ballNrrd(24, 8) });
      await mine.waitForURL(/#\/volumes\//);
      await mine.getByRole('button', { name: 'Make the surface' }).waitFor();
      await mine.keyboard.press('Control+Enter');
      await mine.waitForURL(/#\/jobs\//);
      await surfaceLoaded(mine);
      const download = mine.waitForEvent('download');
      await mine.locator('[data-format=glb]').click();
      expect(readFileSync(await (await download).path()).subarray(0, 4).toString()).toBe('glTF');
      await mine.reload();
      await surfaceLoaded(mine);
      expect(mine.url()).not.toContain(token);
      await mine.close();
      expect(none).toEqual([]);
    });
  });
});

describe('a refused file', () => {
  it('says why, and what to do next', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    const whole = readFileSync(brain);
    await drop(page, [{ name: 'half.nii.gz', bytes: whole.subarray(0, whole.length / 2) }]);
    await expect.poll(() => page.locator('.refusal').innerText()).toMatch(/\w{4}/);
    expect(await page.locator('.refusal .advice').innerText()).not.toBe('');
    await page.getByRole('button', { name: 'Choose another file' }).click();
    await expect.poll(() => page.getByRole('button', { name: 'Choose files' }).isVisible()).toBe(true);
  });
});
