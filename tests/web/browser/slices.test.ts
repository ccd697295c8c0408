// Slices and parameters never show or use something else than what is asked for.
import type { Locator, Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { contourPixels } from './seen';
import { ballNrrd, boxOf, drag, labelsNrrd, noted, nrrdHeader, openedJob, settled, setup } from './support';

const { at, it } = setup();
let ball: string;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(48, 18));
});

// A cube of samples that grow along z, in slices that each lie farther back: a gantry tilted by that angle.
function tiltedNrrd(size: number, degrees: number): Buffer {
  const angle = (degrees * Math.PI) / 180;
  const header = nrrdHeader(size).replace('(0,0,1)', `(0,${Math.sin(angle)},${Math.cos(angle)})`);
  const samples = Buffer.alloc(size ** 3, 200);
  return Buffer.concat([Buffer.from(header), samples.fill(100, 0, samples.length / 2)]);
}

async function open(page: Page, query = ''): Promise<void> {
  await page.goto('about:blank');
  await page.goto(`${at.daemon.url}/#/volumes/${ball}?iso=100${query}`);
  await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(50);
}

// Pixels in the middle of a slice that are not black.
function greyPixels(page: Page, plane: string): Promise<number> {
  return page.evaluate((name) => {
    const canvas = document.querySelector<HTMLCanvasElement>(`[data-plane=${name}] canvas`);
    const edge = 30;
    const { data } = canvas?.getContext('2d')?.getImageData(edge, edge, canvas.width - 2 * edge, canvas.height - 2 * edge) ?? { data: [] };
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if ((data[i] ?? 0) > 40) count += 1;
    return count;
  }, plane);
}

// Soft tissue of 40 in air of -1000, with an insert of 1200 that is too small for the page's first window. Samples of a millimetre.
function insertNrrd(size: number): Buffer {
  const samples = new Int16Array(size ** 3);
  const middle = (size - 1) / 2;
  const isNear = (one: number, other: number): boolean => Math.abs(one - other) < 2;
  samples.forEach((_, at) => {
    const [x, y, z] = [at % size, Math.floor(at / size) % size, Math.floor(at / size ** 2)];
    const isInsert = isNear(x, middle + size / 6) && isNear(y, middle) && isNear(z, middle);
    samples[at] = isInsert ? 1200 : Math.hypot(x - middle, y - middle, z - middle) < 0.44 * size ? 40 : -1000;
  });
  const header = `NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: ${size} ${size} ${size}\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nendian: little\nencoding: raw\n\n`;
  return Buffer.concat([Buffer.from(header), Buffer.from(samples.buffer)]);
}

// White pixels in the middle of a slice or a plane, without the letters at its edges.
function whitePixels(canvas: Locator): Promise<number> {
  return canvas.evaluate((one: HTMLCanvasElement) => {
    const edge = 30;
    const { data = [] } = one.getContext('2d', { willReadFrequently: true })?.getImageData(edge, edge, one.width - 2 * edge, one.height - 2 * edge) ?? {};
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (Math.min(data[i] ?? 0, data[i + 1] ?? 0, data[i + 2] ?? 0) > 230) count += 1;
    return count;
  });
}

describe('a slice', () => {
  it('that fails is not another one, and comes by itself later', async ({ page }) => {
    await open(page);
    await expect.poll(() => greyPixels(page, 'axial')).toBeGreaterThan(500);
    await page.route('**/slice.png?axis=z*', (route) => route.abort());
    await page.locator('[data-plane=axial] canvas').press('PageUp');
    const state = page.locator('[data-plane=axial] .slice-state');
    await expect.poll(() => state.innerText()).toBe('Slice 35 could not be loaded');
    await expect.poll(() => page.locator('[data-plane=axial] .slice-place').innerText()).toBe('35 / 48');
    await expect.poll(() => greyPixels(page, 'axial')).toBe(0);
    await expect.poll(() => contourPixels(page, 'axial')).toBe(0);
    // The others are not touched by it.
    await expect.poll(() => greyPixels(page, 'coronal')).toBeGreaterThan(500);
    await page.unroute('**/slice.png?axis=z*');
    await expect.poll(() => greyPixels(page, 'axial')).toBeGreaterThan(500);
    await expect.poll(() => state.innerText()).toBe('');
  });

  it('tells the value under the pointer, which becomes the iso-value', async ({ page }) => {
    await open(page, '&at=24,24,24');
    const canvas = page.locator('[data-plane=axial] canvas');
    const box = await boxOf(canvas);
    // A ball of 18 mm with 100 on its surface, 8 more for each millimetre inwards; 48 mm fill the cell's height.
    const scale = (Math.min(box.width, box.height) - 28) / 48;
    const position = { x: box.width / 2 + 13.5 * scale, y: box.height / 2 - 0.5 * scale };
    await canvas.hover({ position });
    const text = page.locator('[data-plane=axial] .slice-reading');
    await expect.poll(() => text.innerText()).toMatch(/^\d+$/);
    const told = Number(await text.innerText());
    expect(Math.abs(told - 132)).toBeLessThan(12);
    await canvas.dblclick({ position });
    await expect.poll(() => noted(page, 'iso')).toBe(String(told));
    await expect.poll(() => page.locator('.iso-input').inputValue()).toBe(String(told));
  });

  it('has exact values of 16 bits, at the ends of a length, along it and in an area', async ({ page, daemon }) => {
    const volume = await daemon.upload(insertNrrd(64));
    const measures = 'length,axial,31,31,31,42,31;area,axial,31,25,25,35,25,35,35,25,35';
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=300&window=-1000,40&at=42,31,31&measured=${measures}`);
    const canvas = page.locator('[data-plane=axial] canvas');
    const value = page.locator('[data-plane=axial] .slice-reading');
    await expect.poll(() => value.innerText()).toBe('1\u202f200');
    await expect.poll(() => canvas.getAttribute('aria-label')).toContain('11 mm, 40 to 1\u202f200');
    expect(await canvas.getAttribute('aria-label')).toContain('mean 40, SD 0, 40 to 40');
    await expect.poll(() => page.locator('.slice-profile figcaption').innerText()).toContain('greatest 1\u202f200');
    await canvas.press('i');
    await expect.poll(() => noted(page, 'iso')).toBe('1200');
  });

  it('has lines whose crossing can be dragged, and a window elsewhere', async ({ page }) => {
    await open(page, '&at=24,24,24');
    const box = await boxOf(page.locator('[data-plane=axial] canvas'));
    const scale = (Math.min(box.width, box.height) - 28) / 48;
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const before = await settled(page, () => noted(page, 'window'));
    await drag(page, [x, y], [x + 6 * scale, y + 3 * scale]);
    // The address has the last place soon.
    await expect.poll(() => noted(page, 'at').split(',').map((one, axis) => Math.abs(Math.abs(Number(one) - 24) - ([6, 3, 0][axis] ?? 0)) <= 1)).toEqual([true, true, true]);
    expect(noted(page, 'window')).toBe(before);
    await drag(page, [x - 60, y - 60], [x - 20, y - 60]);
    await expect.poll(() => noted(page, 'window')).not.toBe(before);
  });

  it('moves by the distance of a wheel, also of a trackpad', async ({ page }) => {
    await open(page, '&at=24,24,24');
    const place = page.locator('[data-plane=axial] .slice-place');
    await page.locator('[data-plane=axial] canvas').hover();
    for (let event = 0; event < 40; event += 1) await page.mouse.wheel(0, 2);
    await expect.poll(() => place.innerText()).toBe('28 / 48');
    for (let notch = 0; notch < 3; notch += 1) await page.mouse.wheel(0, -100);
    await expect.poll(() => place.innerText()).toBe('25 / 48');
    await page.keyboard.down('Control');
    for (let notch = 0; notch < 5; notch += 1) await page.mouse.wheel(0, -100);
    await page.keyboard.up('Control');
    await expect.poll(() => page.locator('[data-plane=axial] .slice-zoom').innerText()).toMatch(/^1\.6/);
  });

  it('of a tilted gantry leans as the slices lie', async ({ page, daemon }) => {
    const volume = await daemon.upload(tiltedNrrd(40, 18.5));
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=150&window=0,255`);
    await expect.poll(() => greyPixels(page, 'sagittal')).toBeGreaterThan(500);
    // Where the grey begins in rows near the top and the bottom.
    const begins = await page.evaluate(() => {
      const canvas = document.querySelector<HTMLCanvasElement>('[data-plane=sagittal] canvas');
      const context = canvas?.getContext('2d');
      if (!canvas || !context) throw new Error('there is no slice');
      return [0.15, 0.85].map((part) => {
        const y = Math.round(part * canvas.height);
        const { data } = context.getImageData(0, y, canvas.width, 1);
        for (let x = 15; x < canvas.width; x += 1) if ((data[4 * x] ?? 0) > 60) return { x, y };
        throw new Error('the row is black');
      });
    });
    const [top, bottom] = begins as [{ x: number; y: number }, { x: number; y: number }];
    // The front is on the left, and slices further up lie farther back.
    const degrees = (180 * Math.atan2(top.x - bottom.x, bottom.y - top.y)) / Math.PI;
    expect(degrees).toBeGreaterThan(17);
    expect(degrees).toBeLessThan(20);
    // A click there is a place in the volume, and one beside it none.
    const canvas = page.locator('[data-plane=sagittal] canvas');
    const before = noted(page, 'at');
    await canvas.click({ position: { x: bottom.x + 4, y: bottom.y } });
    await expect.poll(() => noted(page, 'at')).not.toBe(before);
    const place = noted(page, 'at');
    await canvas.click({ position: { x: bottom.x + 4, y: top.y } });
    // What is noted later comes into the address with it or after it.
    await page.locator('.iso-input').fill('160');
    await expect.poll(() => noted(page, 'iso')).toBe('160');
    expect(noted(page, 'at')).toBe(place);
  });
});

describe('slices before there is a mesh', () => {
  it('tell places in millimetres, in the space that a person chooses', async ({ page }) => {
    await open(page);
    const text = page.locator('[data-plane=axial] .slice-value');
    // The middle of 48 samples of a millimetre, where the slices meet.
    await expect.poll(() => text.innerText()).toMatch(/\d+ \u00b7 LPS 24, 24, 24 mm$/);
    await page.getByLabel('Coordinates').selectOption('RAS');
    await expect.poll(() => text.innerText()).toContain('RAS \u221224, \u221224, 24 mm');
  });

  it('show another volume over them where it lies in the patient, and the maximum of a slab', async ({ page, daemon }) => {
    // A block of 11 mm on the left and at the back of the ball, whose axes run in another order and the other way.
    const block = Buffer.from(Array.from({ length: 12 ** 3 }, (_, i) => 200 + ((7 * i) % 50)));
    const header = 'NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 12 12 12\nspace directions: (0,1,0) (1,0,0) (0,0,-1)\nspace origin: (30,30,35)\nencoding: raw\n\n';
    block[0] = 0;
    const overlay = await daemon.upload(Buffer.concat([Buffer.from(header), block]));
    await page.goto('about:blank');
    await page.goto(`${daemon.url}/#/volumes/${ball}?iso=100&at=24,24,30`);
    await expect.poll(() => greyPixels(page, 'axial')).toBeGreaterThan(500);
    const coloured = (): Promise<{ count: number; isRight: boolean; isBelow: boolean }> =>
      page.evaluate(() => {
        const canvas = document.querySelector<HTMLCanvasElement>('[data-plane=axial] canvas');
        const { width = 0, height = 0 } = canvas ?? {};
        const data = canvas?.getContext('2d')?.getImageData(0, 0, width, height).data ?? [];
        const found: [number, number][] = [];
        for (let i = 0; i < data.length; i += 4) {
          if ((data[i] ?? 0) > (data[i + 2] ?? 0) + 60 && (data[i] ?? 0) > 120) found.push([(i / 4) % width, Math.floor(i / 4 / width)]);
        }
        return { count: found.length, isRight: found.every(([x]) => x > width / 2), isBelow: found.every(([, y]) => y > height / 2) };
      });
    expect((await coloured()).count).toBe(0);
    const other = page.getByLabel('Overlay', { exact: true });
    await other.selectOption(overlay);
    await expect.poll(async () => (await coloured()).count).toBeGreaterThan(100);
    expect(await coloured()).toMatchObject({ isRight: true, isBelow: true });
    await page.getByLabel('Opacity of the overlay').fill('0');
    await expect.poll(async () => (await coloured()).count).toBe(0);
    // At the ball's pole there is little; a slab of 40 mm reaches its middle.
    const many = await settled(page, () => greyPixels(page, 'axial'));
    await page.locator('[data-plane=axial] input[type=range]').fill('8');
    await expect.poll(() => greyPixels(page, 'axial')).toBeLessThan(many / 1.2);
    const few = await settled(page, () => greyPixels(page, 'axial'));
    await page.getByLabel('Show', { exact: true }).selectOption('maximum');
    await page.getByLabel('Thickness', { exact: true }).selectOption('40');
    await expect.poll(() => greyPixels(page, 'axial')).toBeGreaterThan(1.25 * few);
    // All of that is in the address, with what is measured.
    await page.getByLabel('Colours', { exact: true }).selectOption('Hot iron');
    await page.getByLabel('Coordinates').selectOption('RAS');
    await page.getByLabel('Layout', { exact: true }).selectOption('First large');
    await page.getByLabel('Oblique plane', { exact: true }).check();
    await page.getByLabel('Tilt of the oblique plane').fill('20');
    await page.locator('.oblique-picture[data-angles="30,20"]').waitFor();
    await page.getByRole('radio', { name: 'Length' }).check({ force: true });
    const axial = page.locator('[data-plane=axial] canvas');
    for (const x of [200, 300]) await axial.click({ position: { x, y: 300 } });
    await expect.poll(() => axial.getAttribute('aria-label')).toMatch(/ mm, \d+ to \d+$/);
    const said = await axial.getAttribute('aria-label');
    await expect.poll(() => noted(page, 'measured')).toMatch(/^length,axial,8,/);
    await page.reload();
    await expect.poll(() => axial.getAttribute('aria-label')).toBe(said);
    await page.locator('.oblique-picture[data-angles="30,20"]').waitFor();
    expect(await page.getByLabel('Oblique plane', { exact: true }).isChecked()).toBe(true);
    const controls = ['Show', 'Thickness', 'Colours', 'Coordinates', 'Layout'];
    expect(await Promise.all(controls.map((name) => page.getByLabel(name, { exact: true }).inputValue()))).toEqual(['maximum', '40', 'hot', 'RAS', 'large']);
    await expect.poll(() => page.locator('[data-plane=axial] .slice-where').innerText()).toContain('RAS');
  });

  it('show labels over them in the colours and with the names of their file', async ({ page, daemon }) => {
    const fields = ['Segment0_ID:=a', 'Segment0_Name:=Left half', 'Segment0_LabelValue:=1', 'Segment0_Layer:=0', 'Segment0_Color:=0 0 1'];
    const overlay = await daemon.upload(labelsNrrd(48, fields));
    await page.goto('about:blank');
    await page.goto(`${daemon.url}/#/volumes/${ball}?iso=100&at=16,24,24`);
    await expect.poll(() => greyPixels(page, 'axial')).toBeGreaterThan(500);
    const choice = page.getByLabel('Overlay', { exact: true });
    // A volume may be called "None".
    await expect.poll(() => choice.locator('option').first().innerText()).toBe('No overlay');
    await choice.selectOption(overlay);
    await page.getByLabel('Opacity of the overlay').fill('1');
    const blue = (): Promise<number> =>
      page.evaluate(() => {
        const canvas = document.querySelector<HTMLCanvasElement>('[data-plane=axial] canvas');
        const data = canvas?.getContext('2d')?.getImageData(0, 0, canvas.width, canvas.height).data ?? [];
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (data[i] === 0 && data[i + 1] === 0 && data[i + 2] === 255) count += 1;
        return count;
      });
    await expect.poll(blue).toBeGreaterThan(500);
    await expect.poll(() => page.locator('[data-plane=axial] .slice-reading').innerText()).toMatch(/Left half/);
  });

  it('show bright structures in a slab over any window', async ({ page, daemon }) => {
    const volume = await daemon.upload(insertNrrd(64));
    const axial = page.locator('[data-plane=axial] canvas');
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=-480&at=42,32,32&window=0,1000`);
    await expect.poll(() => whitePixels(axial)).toBeGreaterThan(50);
    // A slab of 10 mm around this place holds the insert, and its middle slice does not.
    await page.goto('about:blank');
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=-480&at=42,32,36&window=0,1000`);
    await page.getByLabel('Show', { exact: true }).selectOption('maximum');
    await expect.poll(() => whitePixels(axial)).toBeGreaterThan(50);
    // The first window once more: what is in it is seen again as before, and the insert stays.
    const choice = page.getByLabel('Window', { exact: true });
    const chosen = (): Promise<string | undefined> => choice.evaluate((one: HTMLSelectElement) => one.selectedOptions[0]?.textContent ?? undefined);
    expect(await chosen()).toBe('Custom');
    await page.getByRole('button', { name: 'Reset window' }).click();
    await expect.poll(() => whitePixels(axial)).toBeGreaterThan(1000);
    expect(await chosen()).toBe('Usual');
    // A window for CT that was left by a drag can be chosen again.
    for (const key of ['Shift+ArrowRight', 'Shift+ArrowUp']) {
      await choice.selectOption('Lung');
      await expect.poll(() => noted(page, 'window')).toBe('-1350,150');
      await axial.press(key);
      await expect.poll(chosen).toBe('Custom');
    }
  });

  it('tell the value of the slab that is shown, and the iso-value is still that of a sample', async ({ page, daemon }) => {
    const volume = await daemon.upload(insertNrrd(64));
    await page.goto('about:blank');
    await page.goto(`${daemon.url}/#/volumes/${volume}?iso=-480&at=42,32,36&window=-1000,2000`);
    const text = page.locator('[data-plane=axial] .slice-reading');
    // Twelve units of the window are one of its eight bits.
    const told = async (): Promise<number> => Number((await text.innerText()).replace('\u2212', '-').replace(/[^\d-]/g, ''));
    await expect.poll(async () => Math.abs((await told()) - 40)).toBeLessThan(13);
    await page.getByLabel('Show', { exact: true }).selectOption('maximum');
    await expect.poll(async () => Math.abs((await told()) - 1200)).toBeLessThan(13);
    expect(await text.innerText()).toMatch(/^about /);
    await page.locator('[data-plane=axial] canvas').press('i');
    await expect.poll(() => Math.abs(Number(noted(page, 'iso')) - 40)).toBeLessThan(13);
  });

  it('are measured, and show it to those who hear them', async ({ page }) => {
    await open(page);
    await page.getByRole('radio', { name: 'Length' }).check({ force: true });
    const canvas = page.locator('[data-plane=axial] canvas');
    const box = await boxOf(canvas);
    const place = noted(page, 'at');
    // Samples of a millimetre, 48 across what the letters leave.
    const scale = (Math.min(box.width, box.height) - 28) / 48;
    await canvas.click({ position: { x: box.width / 2 - 10 * scale, y: box.height / 2 } });
    await canvas.click({ position: { x: box.width / 2 + 10 * scale, y: box.height / 2 } });
    await expect.poll(() => canvas.getAttribute('aria-label')).toMatch(/, (19\.[5-9]|20(\.[0-5])?) mm(, \d+ to \d+)?$/);
    expect(noted(page, 'at')).toBe(place);
    // The length stands on its ground, 8 pixels from the point and below it.
    const coloured = (from: number, to: number): Promise<number> =>
      canvas.evaluate(
        (one: HTMLCanvasElement, [left, right, middle]) => {
          const { data = [] } = one.getContext('2d', { willReadFrequently: true })?.getImageData(left, middle + 14, right - left, 4) ?? {};
          let count = 0;
          for (let i = 0; i < data.length; i += 4) if ((data[i] ?? 0) > (data[i + 2] ?? 0) + 60) count += 1;
          return count;
        },
        [Math.round(box.width / 2 + 10 * scale) + from, Math.round(box.width / 2 + 10 * scale) + to, Math.round(box.height / 2)] as const,
      );
    await expect.poll(() => coloured(8, 60)).toBeGreaterThan(10);
    expect(await coloured(-40, 6)).toBe(0);
    // A drag is no window while a person measures.
    const before = noted(page, 'window');
    await drag(page, [box.x + box.width / 2 - 60, box.y + box.height / 2 - 60], [box.x + box.width / 2 - 20, box.y + box.height / 2 - 60]);
    expect(await settled(page, () => noted(page, 'window'))).toBe(before);
    // Keys that are pressed in a dialog are the dialog's.
    await page.keyboard.press('?');
    const dialog = page.locator('dialog.help');
    await dialog.waitFor();
    await page.keyboard.press('Control+Enter');
    await page.keyboard.press('Delete');
    await dialog.getByRole('heading').click();
    for (const key of ['?', 'Delete', 'Escape']) await page.keyboard.press(key);
    await expect.poll(() => dialog.count()).toBe(0);
    await expect.poll(() => canvas.getAttribute('aria-label')).toContain('mm');
    expect(page.url()).toContain('#/volumes/');
    await page.keyboard.press('Escape');
    await expect.poll(() => canvas.getAttribute('aria-label')).not.toContain('mm');
  });

  it('take the whole room one by one, and give it back', async ({ page }) => {
    await open(page);
    const all = page.locator('.slices > figure:not([hidden])');
    const [axial, coronal] = [page.locator('[data-plane=axial]'), page.locator('[data-plane=coronal]')];
    await expect.poll(() => all.count()).toBe(4);
    const before = (await axial.boundingBox())?.width ?? 0;
    await page.getByRole('button', { name: 'Enlarge axial slices' }).click();
    await expect.poll(() => coronal.isVisible()).toBe(false);
    expect((await axial.boundingBox())?.width).toBeGreaterThan(1.9 * before);
    await axial.locator('.slice-title').dblclick();
    await expect.poll(() => coronal.isVisible()).toBe(true);
  });
});

describe('parameters', () => {
  it('that are no values of theirs make nothing, and say what they have to be', async ({ page }) => {
    await open(page);
    const passes = page.locator('[data-parameter=passes] input');
    await page.locator('.parameters summary').click();
    const run = page.getByRole('button', { name: 'Make the surface' });
    for (const wrong of ['1001', '2.5', '', '-1']) {
      await passes.fill(wrong);
      await expect.poll(() => run.isDisabled()).toBe(true);
      expect(await page.locator('[data-parameter=passes] .fault').innerText()).toBe(
        'Enter a whole number, at least 0 and at most 1000.',
      );
      await page.keyboard.press('Control+Enter');
    }
    expect(page.url()).toContain('#/volumes/');
    await passes.fill('7');
    await expect.poll(() => run.isEnabled()).toBe(true);
    await expect.poll(() => page.locator('[data-parameter=passes] .fault').isVisible()).toBe(false);
    await run.click();
    await page.waitForURL(/#\/jobs\//);
    expect((await openedJob(at)).parameters['passes']).toBe(7);
  });

  it('begin with an iso-value that can be read', async ({ page, daemon }) => {
    const samples = Float32Array.from({ length: 1000 }, (_, n) => (n < 400 ? 101.123456 : 20087.765432));
    const header = 'NRRD0004\ntype: float\ndimension: 3\nsizes: 10 10 10\nendian: little\nencoding: raw\n\n';
    const volume = await daemon.upload(Buffer.concat([Buffer.from(header), Buffer.from(samples.buffer)]));
    await page.goto(`${daemon.url}/#/volumes/${volume}`);
    await expect.poll(() => page.locator('.iso-input').inputValue()).toMatch(/^\d{5}(\.\d)?$/);
    await expect.poll(() => noted(page, 'iso')).toBe(await page.locator('.iso-input').inputValue());
  });
});
