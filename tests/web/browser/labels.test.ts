// A segmentation: its labels are chosen, meshed, looked at one by one, and downloaded.
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import type { Locator, Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { hues, type Hues } from './seen';
import { boxOf, type JobAnswer, labelsNrrd, openedJob, openSurface, setup, still, surfaceLoaded } from './support';

const { at, it } = setup();
let volume: string;
let made: JobAnswer;

beforeAll(async () => {
  volume = await at.daemon.upload(labelsNrrd(32));
  made = await at.daemon.make({
    volume,
    labels: 'all',
    label_names: { 1: 'Right half', 2: 'Left half' },
    label_colors: { 1: '#d02020', 2: '#2040e0' },
    formats: ['glb', 'stl'],
  });
});

async function openForm(page: Page, query = ''): Promise<Locator> {
  await page.goto('about:blank');
  await page.goto(`${at.daemon.url}/#/volumes/${volume}${query}`);
  await page.getByRole('radio', { name: 'Each label' }).check();
  const rows = page.locator('.label-choice .labels li');
  await expect.poll(() => rows.count()).toBe(3);
  return rows;
}

async function estimated(page: Page): Promise<string> {
  await expect.poll(() => page.locator('.estimate:not(.stale) dl').count()).toBe(1);
  return page.locator('.estimate dd').first().innerText();
}

async function make(page: Page): Promise<JobAnswer> {
  await page.getByRole('button', { name: 'Make the surface' }).click();
  await page.waitForURL(/#\/jobs\//);
  return openedJob(at);
}

describe('the labels of a surface', () => {
  it('are put into an order, and saved as a table', async ({ page, daemon }) => {
    const { id } = await daemon.make({ volume, labels: 'all', formats: ['glb'] });
    await openSurface(at, id);
    const rows = page.locator('.label-list .labels li');
    const order = (): Promise<(string | undefined)[]> => rows.evaluateAll((all) => all.map((row) => (row as HTMLElement).dataset.label));
    await expect.poll(order).toEqual(['1', '2', '5']);
    await page.getByLabel('Order of the labels').selectOption('largest volume first');
    await expect.poll(async () => (await order()).at(-1)).toBe('5');
    await page.getByLabel('Order of the labels').selectOption('by name');
    await page.getByLabel('Search the labels').fill('5');
    await expect.poll(order).toEqual(['5']);
    await expect.poll(() => rows.innerText()).toMatch(/volume .* mm³, of its voxels .* mm³; area .* mm²\s*1 component, .* triangles/);
    const saving = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Save as CSV' }).click();
    const file = await saving;
    expect(file.suggestedFilename()).toMatch(/-labels\.csv$/);
    const lines = readFileSync(await file.path()).toString().trim().split('\r\n');
    // All of them, whatever is searched for.
    expect(lines).toHaveLength(4);
    expect(lines[3]).toMatch(/^5,label 5,#[0-9a-f]{6},\d+,/);
  });
});

describe('the labels of a volume', () => {
  it('have their colours in slices and in a preview, and their names under the pointer', async ({ page }) => {
    await page.setViewportSize({ width: 1180, height: 760 });
    // A slab and a plane between samples are for values: with labels they are off.
    const rows = await openForm(page, '?slab=maximum-10&oblique=30,0');
    const axial = page.locator('[data-plane=axial]');
    // Half of the ball is each label, so that two colours are there; what is between has none.
    const colours = (): Promise<string[]> =>
      axial.locator('canvas').evaluate((canvas: HTMLCanvasElement) => {
        const { data } = canvas.getContext('2d')?.getImageData(0, 0, canvas.width, canvas.height) ?? { data: [] };
        const counts = new Map<string, number>();
        for (let at = 0; at < data.length; at += 4) {
          const [red = 0, green = 0, blue = 0] = [data[at], data[at + 1], data[at + 2]];
          // Grey has equal parts.
          if (Math.max(red, green, blue) - Math.min(red, green, blue) < 40) continue;
          const hue = [red, green, blue].map((part) => Math.round((4 * part) / Math.max(red, green, blue))).join();
          counts.set(hue, (counts.get(hue) ?? 0) + 1);
        }
        return [...counts].filter(([, count]) => count > 400).map(([hue]) => hue);
      });
    await expect.poll(async () => (await colours()).length).toBe(2);
    for (const name of ['Show', 'Thickness', 'Oblique plane']) expect(await page.getByLabel(name, { exact: true }).isDisabled()).toBe(true);
    expect(await page.locator('.oblique').isVisible()).toBe(false);
    await expect.poll(() => page.locator('.live-picture[data-still]').count()).toBe(1);
    const preview = async (): Promise<number> => {
      const { red, green, blue } = await hues(page, page.locator('.live-picture'));
      return red + green + blue;
    };
    await expect.poll(preview).toBeGreaterThan(2000);
    const box = await boxOf(axial.locator('canvas'));
    await page.mouse.move(box.x + 0.42 * box.width, box.y + box.height / 2);
    await expect.poll(() => axial.locator('.slice-value').innerText()).toContain('label 1');
    await page.mouse.move(box.x + 0.58 * box.width, box.y + box.height / 2);
    await expect.poll(() => axial.locator('.slice-value').innerText()).toContain('label 2');
    // What is not chosen is not seen.
    await rows.filter({ hasText: 'label 1' }).getByRole('checkbox').uncheck();
    await expect.poll(async () => (await colours()).length).toBe(1);
  });

  it('have the colours of their surfaces beside these and in their cut, also when a person chooses others', async ({ page }) => {
    await openSurface(at, `${made.id}?slices=on`);
    const seen = async (): Promise<Hues> => hues(page, page.locator('[data-plane=axial] canvas'));
    await expect.poll(async () => (await seen()).red).toBeGreaterThan(300);
    await expect.poll(async () => (await seen()).blue).toBeGreaterThan(300);
    await page.getByLabel('Colour of Right half').fill('#20c020');
    await expect.poll(async () => (await seen()).green).toBeGreaterThan(300);
    expect((await seen()).red).toBe(0);
    // The cut from above shows the slice.
    await page.keyboard.press('s');
    await page.keyboard.press('c');
    await page.locator('.viewport[data-slice]').waitFor();
    await page.getByRole('button', { name: 'Hide all' }).click();
    await still(page);
    expect(await hues(page, page.locator('.viewport'))).toMatchObject({ red: 0, green: 0, blue: 0 });
  });

  it('are all meshed unless some are picked', async ({ page }) => {
    const rows = await openForm(page);
    await expect.poll(() => rows.allInnerTexts()).toEqual([
      expect.stringMatching(/label 1[^]*voxels/),
      expect.stringMatching(/label 2[^]*voxels/),
      expect.stringMatching(/label 5[^]*200 voxels/),
    ]);
    const all = await estimated(page);
    await expect.poll(() => page.locator('[data-parameter=interpolation]').count()).toBe(0);
    await expect.poll(() => page.getByRole('slider', { name: 'Iso-value' }).isVisible()).toBe(false);
    const job = await make(page);
    expect(job.parameters).toMatchObject({ labels: 'all', passes: 10 });
    expect(job.parameters).not.toHaveProperty('iso');
    await expect.poll(() => page.locator('h1').innerText()).toBe('Surfaces of all labels');
    await surfaceLoaded(page);
    expect(`${(await openedJob(at)).mesh?.triangles}`).toBe(all.replaceAll('\u202f', ''));
  });

  it('are found by their value, picked, and said in the address', async ({ page }) => {
    const rows = await openForm(page);
    await page.getByLabel('Search the labels').fill('5');
    await expect.poll(() => rows.count()).toBe(1);
    await page.getByRole('button', { name: 'None', exact: true }).click();
    await page.getByLabel('Search the labels').fill('');
    await expect.poll(() => rows.locator('input:checked').count()).toBe(2);
    await expect.poll(() => page.url()).toMatch(/labels=1%2C2|labels=1,2/);
    await page.reload();
    await expect.poll(() => rows.locator('input:checked').count()).toBe(2);
    expect((await make(page)).parameters).toMatchObject({ labels: [1, 2] });
    await page.getByRole('link', { name: 'Change parameters' }).click();
    await expect.poll(() => rows.locator('input:checked').count()).toBe(2);
  });

  it('make nothing while none is picked, and give way to an iso-value', async ({ page }) => {
    await openForm(page);
    await page.getByRole('button', { name: 'None', exact: true }).click();
    const run = page.getByRole('button', { name: 'Make the surface' });
    await expect.poll(() => run.isDisabled()).toBe(true);
    await expect.poll(() => page.locator('.estimate').innerText()).toContain('Choose at least one label');
    await page.getByRole('radio', { name: 'One surface' }).check();
    await expect.poll(() => run.isDisabled()).toBe(false);
    const { parameters } = await make(page);
    expect(parameters).toHaveProperty('iso');
    expect(parameters).not.toHaveProperty('labels');
  });
});

describe('more labels than are listed', () => {
  it('are said to be more, and found', async ({ page, daemon }) => {
    const samples = Uint16Array.from({ length: 1000 }, (_, n) => (n < 600 ? n + 1 : 0));
    const header = 'NRRD0004\ntype: uint16\ndimension: 3\nsizes: 10 10 10\nendian: little\nencoding: raw\n\n';
    const many = await daemon.upload(Buffer.concat([Buffer.from(header), Buffer.from(samples.buffer)]));
    await page.goto(`${daemon.url}/#/volumes/${many}?labels=all`);
    const rows = page.locator('.label-choice .labels li');
    await expect.poll(() => rows.count()).toBe(500);
    const count = page.locator('.label-choice .hint[role=status]');
    await expect.poll(() => count.innerText()).toBe('600 of 600 labels; the first 500 are listed');
    await page.getByLabel('Search the labels').fill('577');
    // Rows that are scrolled to are laid out, and have a text, when the page comes to it.
    await expect.poll(() => rows.allInnerTexts()).toEqual([expect.stringMatching(/label 577[^]*1 voxels/)]);
    await expect.poll(() => count.innerText()).toBe('600 of 600 labels');
    await page.getByRole('button', { name: 'None' }).click();
    await expect.poll(() => count.innerText()).toBe('599 of 600 labels');
    // A surface's list says it as well.
    const { id } = await daemon.make({ volume: many, labels: 'all', passes: 0, formats: ['glb'] });
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await expect.poll(() => page.locator('.label-list .labels li').count()).toBe(500);
    await expect.poll(() => page.locator('.label-list .hint[role=status]').first().innerText()).toContain('the first 500 are listed');
  });
});

describe('a segmentation that names its labels', () => {
  // As 3D Slicer writes it; the first name would run if the page took a text for HTML.
  const hostile = '<img src=x onerror="document.title=1">';
  const fields = [
    `Segment0_Name:=${hostile}`,
    'Segment0_LabelValue:=1',
    'Segment0_Color:=1 0 0',
    'Segment0_Layer:=0',
    'Segment1_Name:=Left half',
    'Segment1_LabelValue:=2',
    'Segment1_Color:=0 0 1',
    'Segment1_Layer:=0',
  ];

  it('is listed and shown by these names, in its colours', async ({ page, daemon }) => {
    const id = await daemon.upload(labelsNrrd(28, fields));
    await page.goto('about:blank');
    await page.goto(`${daemon.url}/#/volumes/${id}`);
    const rows = page.locator('.label-choice .labels li');
    await expect.poll(() => rows.count()).toBe(3);
    await expect.poll(() => page.getByRole('radio', { name: 'Each label' }).isChecked()).toBe(true);
    // Rows are laid out, and have a text, when the page comes to them.
    await expect.poll(async () => (await rows.locator('label').allInnerTexts()).map((text) => text.trim())).toEqual([hostile, 'Left half', 'label 5']);
    const swatches = await rows.locator('.swatch').evaluateAll((all) => all.map((one) => getComputedStyle(one).backgroundColor));
    expect(swatches.slice(0, 2)).toEqual(['rgb(255, 0, 0)', 'rgb(0, 0, 255)']);
    await expect.poll(() => rows.first().innerText()).toMatch(/voxels, .*triangles/);

    const { id: job } = await make(page);
    await surfaceLoaded(page);
    await page.keyboard.press('a');
    await still(page);
    const seen = await hues(page, page.locator('.viewport'));
    expect([seen.red > 1000, seen.blue > 1000]).toEqual([true, true]);
    await expect.poll(() => page.locator('.label-list .check').allTextContents()).toEqual([hostile, 'Left half', 'label 5']);
    await expect.poll(() => page.locator('img[src=x]').count()).toBe(0);
    expect(await page.title()).not.toBe('1');

    // By keyboard alone, and with a name for every control.
    const controls = page.locator('.label-list').locator('input, button');
    for (const control of await controls.all()) {
      const name = await control.evaluate((one) => one.getAttribute('aria-label') ?? one.textContent ?? '');
      expect(name.trim(), `a control of job ${job}`).not.toBe('');
    }
    await page.getByRole('checkbox', { name: 'Show Left half' }).focus();
    await page.keyboard.press('Space');
    await still(page);
    expect((await hues(page, page.locator('.viewport'))).blue).toBe(0);
    await page.keyboard.press('Tab');
    expect(await page.evaluate(() => document.activeElement?.getAttribute('aria-label'))).toBe('Show only Left half');
    await page.keyboard.press('Enter');
    await expect.poll(() => page.getByRole('button', { name: 'Show only Left half' }).getAttribute('aria-pressed')).toBe('true');
    await still(page);
    const alone = await hues(page, page.locator('.viewport'));
    expect([alone.red, alone.blue > 1000]).toEqual([0, true]);
    await expect.poll(() => page.getByRole('status').filter({ hasText: 'Left half' }).innerText()).toMatch(/volume .* area/);
  });
});

describe('the surfaces of labels', () => {
  async function open(): Promise<Locator> {
    const { page } = at;
    await page.goto('about:blank');
    await openSurface(at, made.id);
    await page.keyboard.press('a');
    await still(page);
    return page.locator('.viewport');
  }

  async function seen(view: Locator): Promise<Hues> {
    await still(at.page);
    return hues(at.page, view);
  }

  it('have their colours, and are hidden, shown again and coloured', async ({ page }) => {
    const view = await open();
    const first = await seen(view);
    expect(first.red).toBeGreaterThan(1000);
    expect(first.blue).toBeGreaterThan(1000);

    await page.getByRole('button', { name: 'Hide all' }).click();
    let now = await seen(view);
    expect([now.red, now.blue]).toEqual([0, 0]);
    await page.getByRole('button', { name: 'Show all' }).click();
    expect((await seen(view)).red).toBe(first.red);

    await page.getByLabel('Colour of Left half').fill('#20c030');
    now = await seen(view);
    expect(now.blue).toBe(0);
    expect(now.green).toBeGreaterThan(1000);

    // Nothing is no surface, and not that of all labels.
    await page.getByRole('button', { name: 'Hide all' }).click();
    await page.getByRole('button', { name: 'Make what is shown' }).click();
    await page.getByText('No label is shown.').waitFor();
    await page.getByLabel('Save what is shown as').selectOption('ply');
    await expect.poll(() => page.getByText('No label is shown.').count()).toBe(2);
    expect(page.url()).toContain(made.id);
  });

  it('say what they are when they are clicked, and obey keys', async ({ page }) => {
    const view = await open();
    const place = await boxOf(view);
    // From the front the patient's right is on the left.
    await page.mouse.click(place.x + 0.45 * place.width, place.y + 0.5 * place.height);
    const picked = page.locator('.picked-label');
    await expect.poll(() => picked.innerText()).toContain('Right half');
    const label = made.mesh?.labels?.find((one) => one.label === 1);
    const digits = (await picked.innerText()).replace(/[\u202f\s]/g, '');
    expect(digits).toContain(`volume${Math.round(label?.volume_mm3 ?? 0)}mm`);
    expect(digits).toContain(`area${Math.round(label?.area_mm2 ?? 0)}mm`);
    await expect.poll(() => page.locator('.label-list li[aria-current]').innerText()).toContain('Right half');

    await page.keyboard.press('o');
    expect((await seen(view)).blue).toBe(0);
    await page.keyboard.press('e');
    await page.keyboard.press('h');
    const now = await seen(view);
    expect([now.red, await picked.isVisible()]).toEqual([0, false]);
    expect(now.blue).toBeGreaterThan(1000);
    await page.mouse.click(place.x + 0.55 * place.width, place.y + 0.5 * place.height);
    await expect.poll(() => picked.innerText()).toContain('Left half');
    await page.mouse.click(place.x + 5, place.y + 0.8 * place.height);
    await expect.poll(() => picked.isVisible()).toBe(false);
  });

  it('are cut like any surface', async ({ page }) => {
    const view = await open();
    await page.keyboard.press('l');
    const whole = await seen(view);
    expect(whole.blue).toBeGreaterThan(1000);
    await page.keyboard.press('c');
    await page.getByLabel('Direction of the cut').selectOption({ label: 'Coronal' });
    await expect.poll(() => page.locator('.viewport[data-slice^=y]').count()).toBe(1);
    // The camera has turned to the cut; from the side half of the surface is gone.
    await page.keyboard.press('l');
    const cut = await seen(view);
    expect(cut.blue / whole.blue).toBeGreaterThan(0.3);
    expect(cut.blue / whole.blue).toBeLessThan(0.7);
  });

  it('are found by name, and downloaded one by one and all together', async ({ page }) => {
    await open();
    const rows = page.locator('.label-list li');
    await page.getByLabel('Search the labels').fill('half right');
    await expect.poll(() => rows.count()).toBe(1);
    await expect.poll(() => rows.textContent()).toMatch(/Right half/);
    const label = made.mesh?.labels?.find((one) => one.label === 1);

    const one = page.waitForEvent('download');
    await page.getByLabel('Save Right half as').selectOption('STL');
    const stl = readFileSync(await (await one).path());
    expect(stl.length).toBe(84 + 50 * (label?.triangles ?? 0));

    const whole = page.waitForEvent('download');
    await page.locator('.downloads [data-format=zip]').click();
    const zip = readFileSync(await (await whole).path());
    expect(createHash('sha256').update(zip).digest('hex')).toBe(made.mesh?.files.zip?.sha256);
  });

  it('are saved, one or those that are shown, in a format that the job did not make', async ({ page }) => {
    await open();
    const address = page.url();
    const saved = async (choose: () => Promise<unknown>): Promise<{ name: string; text: string }> => {
      const saving = page.waitForEvent('download');
      await choose();
      const file = await saving;
      return { name: file.suggestedFilename(), text: readFileSync(await file.path()).toString('latin1') };
    };
    const one = await saved(() => page.getByLabel('Save Left half as').selectOption('OFF'));
    expect(one.name).toMatch(/-2\.[a-z]+$/);
    const label = made.mesh?.labels?.find(({ label: number }) => number === 2);
    expect(one.text.slice(0, 200)).toMatch(new RegExp(`^(OFF)\\s+\\d+ ${label?.triangles}\\b`));
    // One that is shown alone has its walls to the others, too.
    await page.getByRole('button', { name: 'Show only Left half' }).click();
    const again = await saved(() => page.getByLabel('Save what is shown as').selectOption('OFF'));
    expect(again.name).toMatch(/-2\.off$/);
    expect(again.text).toBe(one.text);
    await page.getByRole('button', { name: 'Show all' }).click();
    await page.getByRole('checkbox', { name: 'Show Left half' }).uncheck();
    const shown = await saved(() => page.getByLabel('Save what is shown as').selectOption('OBJ'));
    expect(shown.name).toMatch(/2-labels\.obj$/);
    expect(await page.locator('.toasts').textContent()).toContain('OBJ of 2 labels without the others');
    expect((shown.text.match(/^o .*$/gm) ?? []).length).toBe(2);
    expect(page.url().split('?')[0]).toBe(address.split('?')[0]);
  });

  it('are listed with those that they touch, by the areas of their walls', async ({ page, daemon }) => {
    const { walls } = await daemon.json<{ walls: { a: number; b: number | null; area_mm2: number; faces: number }[] }>(`/v1/jobs/${made.id}/walls`);
    await open();
    await page.getByText('Who touches whom').click();
    const rows = page.locator('.walls tbody tr');
    await expect.poll(() => rows.count()).toBe(walls.length);
    const columns = [3, 4].map((column) => rows.locator(`td:nth-child(${column})`).allInnerTexts());
    const [areas = [], faces = []] = (await Promise.all(columns)).map((texts) => texts.map((text) => Number(text.replace(/[^\d.]|mm.*/g, ''))));
    expect(areas).toEqual([...areas].sort((a, b) => b - a));
    expect(new Set(faces)).toEqual(new Set(walls.map((wall) => wall.faces)));
    await page.getByLabel('Search the labels').fill('left');
    await expect.poll(() => rows.count()).toBe(walls.filter(({ a, b }) => a === 2 || b === 2).length);
    await expect.poll(() => rows.filter({ hasText: 'Right half' }).innerText()).toMatch(/^Right half\s+Left half\s+\d+/);
  });
});
