// The page as a person uses it: a real volume comes in, its surface goes out.
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { beforeAll, describe, expect } from 'vitest';
import { contourPixels, pixelsOf, silhouette } from './seen';
import {
  ballNrrd,
  boxOf,
  brain,
  brainHull,
  chordOfBall,
  drag,
  drop,
  type JobAnswer,
  keepNotices,
  measured,
  noiseNrrd,
  noted,
  openedJob,
  openSurface,
  settled,
  setup,
  still,
  surfaceLoaded,
} from './support';

const { at, it, alone } = setup();

describe('a real volume', () => {
  it('is dropped, looked at, meshed, turned, downloaded, and still there after a reload', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    await drop(page, [{ name: 'ch2bet.nii.gz', bytes: readFileSync(brain) }]);
    await page.waitForURL(/#\/volumes\/[0-9a-f]{64}/);
    await expect.poll(() => contourPixels(page, 'axial')).toBeGreaterThan(200);

    // The line moves by keyboard and by pointer; contour, address and estimate go with it.
    const line = page.getByRole('slider', { name: 'Iso-value' });
    await line.focus();
    const before = await contourPixels(page, 'axial');
    await page.keyboard.press('Shift+ArrowRight');
    await page.keyboard.press('Shift+ArrowRight');
    await expect.poll(() => contourPixels(page, 'axial')).not.toBe(before);
    const byKeys = Number(await settled(page, () => noted(page, 'iso')));
    const box = await boxOf(line);
    await drag(page, [box.x + box.width * 0.5, box.y + 30], [box.x + box.width * 0.25, box.y + 30]);
    await expect.poll(() => Number(noted(page, 'iso'))).toBeLessThan(byKeys);
    await page.getByLabel('Iso-value', { exact: true }).nth(0).fill(String(brainHull));
    await expect.poll(() => noted(page, 'iso')).toBe(String(brainHull));
    await expect.poll(() => page.locator('.estimate:not(.stale)').count()).toBe(1);
    const estimated = Number(/Triangles\s+([\d\u202f]+)/.exec(await page.locator('.estimate').innerText())?.[1]?.replaceAll('\u202f', ''));

    await page.getByRole('button', { name: 'Make the surface' }).click();
    await page.waitForURL(/#\/jobs\//);
    await surfaceLoaded(page);
    const { mesh } = await openedJob(at);
    if (!mesh) throw new Error('the job made no mesh');
    expect(mesh.triangles).toBe(estimated);

    // From the front: as wide and high as its bounds say.
    await page.getByRole('button', { name: /^Anterior/ }).click();
    await still(page);
    const front = await silhouette(page, page.locator('.viewport'));
    expect(front.part).toBeGreaterThan(0.1);
    expect(front.colours).toBeGreaterThan(50);
    const [low, high] = mesh.bounds;
    const view = await boxOf(page.locator('.viewport'));
    const seen = (front.width * view.width) / (front.height * view.height);
    const real = (high[0] - low[0]) / (high[2] - low[2]);
    // Perspective shows what is nearer larger, and the depths of its edges differ.
    expect(seen / real).toBeGreaterThan(0.85);
    expect(seen / real).toBeLessThan(1.15);

    // Turning it changes the picture, and the address keeps the place.
    await expect.poll(() => noted(page, 'cam')).not.toBe('');
    const fromFront = noted(page, 'cam');
    await page.locator('.viewport canvas').focus();
    for (let i = 0; i < 6; i += 1) await page.keyboard.press('ArrowRight');
    await expect.poll(() => noted(page, 'cam')).not.toBe(fromFront);
    const camera = await settled(page, () => noted(page, 'cam'));

    const download = page.waitForEvent('download');
    await page.locator('[data-format=glb]').click();
    expect((await download).suggestedFilename()).toBe(`ch2bet-iso-${brainHull}.glb`);
    const file = readFileSync(await (await download).path());
    expect(createHash('sha256').update(file).digest('hex')).toBe(mesh.files.glb?.sha256);

    await page.reload();
    await surfaceLoaded(page);
    expect(noted(page, 'cam')).toBe(camera);
    expect((await silhouette(page, page.locator('.viewport'))).part).toBeGreaterThan(0.1);
    await page.goBack();
    await page.waitForURL(/#\/volumes\//);
    await expect.poll(() => contourPixels(page, 'sagittal')).toBeGreaterThan(200);
    expect(noted(page, 'iso')).toBe(String(brainHull));
  });
});

describe('a surface', () => {
  let ball: string;
  let made: JobAnswer;

  beforeAll(async () => {
    ball = await at.daemon.upload(ballNrrd(48, 18));
    made = await at.daemon.make({ volume: ball, iso: 100, passes: 2, formats: ['glb', 'drc', 'stl'] });
  });

  it('of a ball is a disc from every side', async ({ page }) => {
    await openSurface(at, made.id);
    for (const key of ['a', 'l', 's']) {
      await page.keyboard.press(key);
      await still(page);
      const disc = await silhouette(page, page.locator('.viewport'));
      expect(disc.filling, key).toBeGreaterThan(Math.PI / 4 - 0.02);
      expect(disc.filling, key).toBeLessThan(Math.PI / 4 + 0.02);
    }
  });

  it('is cut in half by the plane, which shows the slice', async ({ page }) => {
    await openSurface(at, made.id);
    await page.keyboard.press('a');
    await still(page);
    const whole = await silhouette(page, page.locator('.viewport'));
    const slice = page.waitForResponse(/slice\.png/);
    await page.keyboard.press('c');
    await slice;
    await page.keyboard.press('s');
    // From above the slice covers all of the volume, also where the ball is not; some of its greys are
    // those of the background.
    await expect.poll(async () => (await silhouette(page, page.locator('.viewport'))).filling).toBeGreaterThan(0.9);
    expect((await silhouette(page, page.locator('.viewport'))).part).toBeGreaterThan(whole.part);
    await expect.poll(() => page.locator('.cut-place').innerText()).toBe('25 / 48');

    // The slice can be measured as well: across the volume, of which the ball is only a part.
    const seen = await silhouette(page, page.locator('.viewport'));
    const view = await boxOf(page.locator('.viewport'));
    const millimetres = Number.parseFloat(await measured(page, 0.9 * ((seen.width * view.width) / 2)));
    expect(millimetres).toBeGreaterThan(0.9 * 48 * 0.97);
    expect(millimetres).toBeLessThan(0.9 * 48 * 1.03);
  });

  it('is measured in millimetres', async ({ page }) => {
    await keepNotices(page);
    await openSurface(at, made.id);
    await page.keyboard.press('a');
    await still(page);
    const view = await boxOf(page.locator('.viewport'));
    const disc = await silhouette(page, page.locator('.viewport'));
    const [x = 0, y = 0, z = 0] = (await settled(page, () => noted(page, 'cam'))).split(',').map(Number);
    const expected = chordOfBall(18, Math.hypot(x, y, z), 0.8);
    const millimetres = Number.parseFloat(await measured(page, 0.8 * ((disc.height * view.height) / 2)));
    await page.mouse.click(view.x + view.width / 2, view.y + 3);
    await expect.poll(() => page.locator('.toasts').innerText()).toMatch(/no surface/);
    expect(millimetres).toBeGreaterThan(expected * 0.97);
    expect(millimetres).toBeLessThan(expected * 1.03);
  });

  it('made as Draco alone is shown as well', async ({ daemon, page }) => {
    const draco = await daemon.make({ volume: ball, iso: 100, formats: ['drc'] });
    await openSurface(at, draco.id);
    expect((await silhouette(page, page.locator('.viewport'))).part).toBeGreaterThan(0.1);
  });

  it('comes to rest where frames are too quick for its coarse copy', async ({ page }) => {
    const before = page.viewportSize() ?? { width: 1280, height: 800 };
    try {
      await page.setViewportSize({ width: 360, height: 300 });
      await openSurface(at, made.id);
      const canvas = await boxOf(page.locator('.viewport canvas'));
      await drag(page, [canvas.x + canvas.width / 2, canvas.y + canvas.height / 2], [canvas.x + canvas.width / 2 + 30, canvas.y + canvas.height / 2], 2);
      await still(page);
    } finally {
      await page.setViewportSize(before);
    }
  });

  it('is there again, with its background, after the graphics processor was lost', async ({ page }) => {
    await openSurface(at, made.id);
    await still(page);
    const view = page.locator('.viewport');
    const corner = async (): Promise<number[]> =>
      (await pixelsOf(page, await view.screenshot())).evaluate(({ data, width }) => [...data.subarray(4 * (width - 3), 4 * (width - 2))]);
    const [before, background] = [await silhouette(page, view), await corner()];
    await page.locator('.viewport canvas').evaluate(async (canvas: HTMLCanvasElement) => {
      const context = canvas.getContext('webgl2')?.getExtension('WEBGL_lose_context');
      for (const [name, change] of [['webglcontextlost', () => context?.loseContext()], ['webglcontextrestored', () => context?.restoreContext()]] as const) {
        const changed = new Promise((resolve) => canvas.addEventListener(name, resolve, { once: true }));
        change();
        await changed;
        // A context can be restored once the event is over.
        await new Promise((resolve) => setTimeout(resolve));
      }
    });
    await expect.poll(async () => (await silhouette(page, view)).part).toBeCloseTo(before.part, 2);
    expect(await corner()).toEqual(background);
  });

  it('is compared with others by linked cameras', async ({ daemon, page }) => {
    await page.goto(`${daemon.url}/#/jobs/${made.id}`);
    await page.getByRole('button', { name: '0, 5 and 10 passes' }).click();
    await page.waitForURL(/#\/compare/);
    await surfaceLoaded(page, 3);
    const titles = await page.locator('.cell h2').allInnerTexts();
    expect(titles).toEqual(['iso 100, 0 passes', 'iso 100, 5 passes', 'iso 100, 10 passes']);
    const third = page.locator('.cell .viewport').nth(2);
    const before = await third.screenshot();
    const first = await boxOf(page.locator('.cell .viewport canvas').first());
    await drag(page, [first.x + 150, first.y + 200], [first.x + 230, first.y + 220]);
    await still(page);
    expect(before.equals(await third.screenshot())).toBe(false);
    for (const cell of await page.locator('.cell .viewport').all()) {
      expect((await silhouette(page, cell)).part).toBeGreaterThan(0.05);
    }
    // They begin at one height, however long their heads are.
    await page.locator('.cell h2').first().evaluate((title) => title.append(' of a long title'.repeat(20)));
    const tops = await page.locator('.cell .viewport').evaluateAll((views) => views.map((view) => Math.round(view.getBoundingClientRect().top)));
    expect(new Set(tops).size).toBe(1);
    // Their style is in the address as well.
    const flat = page.getByRole('toolbar', { name: 'View of all surfaces' }).getByRole('button', { name: 'Flat' });
    await flat.click();
    await expect.poll(() => noted(page, 'style')).toBe('flat');
    await page.reload();
    await expect.poll(() => page.locator('.cell [data-tool=flat][aria-pressed=true]').count()).toBe(3);
    expect(await flat.getAttribute('aria-pressed')).toBe('true');
  });
});

describe('a job', () => {
  it('is cancelled while it runs', async ({ daemon, page }) => {
    const volume = await daemon.upload(noiseNrrd(96));
    const { id } = await daemon.submit({ volume, iso: 128, passes: 1000, max_error_mm: 0.01, formats: ['glb'] });
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await expect.poll(() => page.locator('.progress-text').innerText()).toMatch(/%/);
    await page.getByRole('button', { name: 'Cancel' }).click();
    await expect.poll(() => page.locator('.job').getAttribute('data-state')).toBe('cancelled');
    await expect.poll(() => page.locator('.refusal').innerText()).toMatch(/Cancelled/);
    expect((await openedJob(at)).state).toBe('cancelled');
  });

  alone('is shown as lost when nobody answers, and goes on when somebody does', async ({ daemon, page }) => {
    const volume = await daemon.upload(ballNrrd(24, 8));
    await page.goto(`${daemon.url}/#/jobs`);
    await expect.poll(() => page.getByRole('heading', { name: 'Jobs' }).count()).toBe(1);
    await daemon.kill();
    await expect.poll(() => page.locator('.banner').isVisible()).toBe(true);
    await daemon.restart();
    await expect.poll(() => page.locator('.banner').isVisible()).toBe(false);
    await page.goto(`${daemon.url}/#/volumes/${volume}`);
    await expect.poll(() => page.locator('[data-plane]').count()).toBe(3);
  });
});

describe('the page', () => {
  it('is small, compressed and nobody else can serve or frame it', async ({ daemon, page }) => {
    const answer = await fetch(daemon.url);
    const policy = answer.headers.get('content-security-policy') ?? '';
    expect(policy).toContain("default-src 'none'");
    expect(policy).not.toContain('unsafe-inline');
    expect(policy).toContain("frame-ancestors 'none'");
    const files: { path: string; encoding: string | undefined; bytes: number }[] = [];
    page.on('response', (response) => {
      const { pathname: path } = new URL(response.url());
      const headers = response.headers();
      if (path === '/' || path.startsWith('/assets/')) {
        files.push({ path, encoding: headers['content-encoding'], bytes: Number(headers['content-length']) });
      }
    });
    // With a surface, so that what draws is counted; its decoder is not.
    const volume = await daemon.upload(ballNrrd(16, 5));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['stl'] });
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await expect.poll(() => page.locator('.overlay.message').count()).toBe(1);
    // The file with three is the only one of that size.
    await expect.poll(() => files.some(({ bytes }) => bytes > 100_000)).toBe(true);
    // What fits into a packet is as soon there as it is.
    const large = files.filter(({ path, bytes }) => /\.(js|css)$/.test(path) && bytes > 1400);
    expect(large.filter(({ encoding }) => encoding !== 'gzip')).toEqual([]);
    expect(large.length).toBeGreaterThan(1);
    expect(files.some(({ path }) => path.endsWith('.wasm'))).toBe(false);
    const bytes = files.reduce((sum, file) => sum + file.bytes, 0);
    expect(bytes).toBeGreaterThan(50_000);
    expect(bytes).toBeLessThan(400_000);
  });

  it('can be used by keyboard, and every control has a name', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    await expect.poll(() => page.locator('.drop').count()).toBe(1);
    for (const place of ['', '#/jobs', `#/volumes/${await daemon.upload(ballNrrd(16, 5))}`]) {
      await page.goto(`${daemon.url}/${place}`);
      await expect.poll(() => page.locator('main[aria-busy]').count()).toBe(0);
      const nameless = await page.evaluate(() =>
        [...document.querySelectorAll<HTMLElement>('button, a, input:not([hidden]), select, [role=slider]')]
          .filter((control) => control.offsetParent !== null)
          .filter((control) => {
            const labels = (control as HTMLInputElement).labels;
            const label = labels && labels.length > 0 ? labels[0]?.textContent : '';
            const name = control.getAttribute('aria-label') ?? (control.textContent?.trim() || label);
            return !name?.trim();
          })
          .map((control) => control.outerHTML.slice(0, 120)),
      );
      expect(nameless).toEqual([]);
    }
    await page.keyboard.press('g');
    await page.keyboard.press('j');
    await page.waitForURL(/#\/jobs$/);
    await page.keyboard.press('?');
    await expect.poll(() => page.locator('dialog.help').count()).toBe(1);
  });
});
