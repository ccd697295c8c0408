// WebGPU and WebGL 2 paint the same preview, and WebGL 2 paints if WebGPU cannot. Options give Chromium a WebGPU that software draws;
// if it has none even so, the tests that need it say so.
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it, type TaskContext } from 'vitest';
import { pixelsOf } from './seen';
import { ballNrrd, Daemon, labelsNrrd, openPage, startBrowser, webGpuOptions } from './support';

const without: string[] = [];
let daemon: Daemon;
let browsers: { gl: Browser; gpu: Browser };
let hasGpu = false;
let ball: string;
let labels: string;

beforeAll(async () => {
  daemon = await Daemon.start();
  browsers = { gl: await startBrowser(without), gpu: await startBrowser(webGpuOptions) };
  ball = await daemon.upload(ballNrrd(80, 30));
  labels = await daemon.upload(labelsNrrd(40));
  const { page } = await openPage(browsers.gpu, daemon.url);
  await page.goto(daemon.url);
  hasGpu = await page.evaluate(async () => ((await navigator.gpu?.requestAdapter()) ?? null) !== null);
  await page.close();
});

afterAll(async () => {
  await browsers?.gl.close();
  await browsers?.gpu.close();
  await daemon?.remove();
});

// Waits until that painter has drawn the preview at rest.
async function shown(browser: Browser, place: string, painter: string): Promise<{ page: Page; picture: Buffer }> {
  const { page, faults } = await openPage(browser, daemon.url);
  await page.goto(`${daemon.url}/#/volumes/${place}`);
  await page.locator(`.live[data-size] .live-picture[data-still][data-painter=${painter}]`).waitFor();
  expect(faults).toEqual([]);
  return { page, picture: await page.locator('.live-picture').screenshot() };
}

// The mean difference of a channel, of 255, and the share of pixels that are not background.
async function compared(page: Page, one: Buffer, other: Buffer): Promise<{ mean: number; seen: number }> {
  const [a, b] = [await pixelsOf(page, one), await pixelsOf(page, other)];
  return page.evaluate(([first, second]) => {
    let sum = 0;
    let seen = 0;
    const { data, width, height } = first;
    for (let at = 0; at < data.length; at += 4) {
      const background = 4 * Math.floor(at / 4 / width) * width;
      let isSeen = false;
      for (let channel = 0; channel < 3; channel += 1) {
        sum += Math.abs((data[at + channel] ?? 0) - (second.data[at + channel] ?? 0));
        isSeen ||= Math.abs((data[at + channel] ?? 0) - (data[background + channel] ?? 0)) > 24;
      }
      if (isSeen) seen += 1;
    }
    return { mean: sum / (3 * width * height), seen: seen / (width * height) };
  }, [a, b] as const);
}

function skipWithout(context: TaskContext): void {
  if (hasGpu) return;
  process.stdout.write(`Skipped: this browser has no WebGPU: ${context.task.name}\n`);
  context.skip();
}

describe('the preview by WebGPU', () => {
  for (const [name, place] of [
    ['of a surface', (): string => `${ball}?iso=100`],
    ['of what is looked through', (): string => `${ball}?iso=100&look=MR`],
    ['of labels', (): string => labels],
    ['of a crop', (): string => `${ball}?iso=100&crop=-20,-20,-20,60,38,60`],
  ] as const) {
    it(`${name} is the one by WebGL 2`, async (context) => {
      skipWithout(context);
      const gl = await shown(browsers.gl, place(), 'webgl2');
      const gpu = await shown(browsers.gpu, place(), 'webgpu');
      const { mean, seen } = await compared(gl.page, gl.picture, gpu.picture);
      expect(seen).toBeGreaterThan(0.04);
      expect(mean).toBeLessThan(1);
      await gl.page.close();
      await gpu.page.close();
    });
  }

  it('goes on by WebGL 2 when the browser gives WebGPU up', async (context) => {
    skipWithout(context);
    const { page, faults } = await openPage(browsers.gpu, daemon.url);
    // The device as the page gets it, to be lost by the test.
    await page.addInitScript(() => {
      const made = GPUAdapter.prototype;
      // eslint-disable-next-line @typescript-eslint/unbound-method -- called on their adapters below
      const { requestDevice } = made;
      made.requestDevice = async function (...given) {
        const device = await requestDevice.apply(this, given);
        Object.assign(window, { device });
        return device;
      };
    });
    await page.goto(`${daemon.url}/#/volumes/${ball}?iso=100`);
    await page.locator('.live-picture[data-still][data-painter=webgpu]').waitFor();
    await page.evaluate(() => (window as unknown as { device: GPUDevice }).device.destroy());
    await page.locator('.live-picture[data-still][data-painter=webgl2]').waitFor();
    expect(await page.locator('.live-picture canvas').count()).toBe(1);
    expect(faults).toEqual([]);
    await page.close();
  });
});

describe('the preview by WebGL 2', () => {
  // How a browser says that it has no WebGPU.
  for (const [name, lose] of [
    ['there is no WebGPU', (): void => void Object.defineProperty(Navigator.prototype, 'gpu', { value: undefined })],
    ['WebGPU has no adapter', (): void => void (GPU.prototype.requestAdapter = (): Promise<null> => Promise.resolve(null))],
    ['WebGPU has no device', (): void => void (GPUAdapter.prototype.requestDevice = (): Promise<never> => Promise.reject(new Error('none')))],
    ['WebGPU rejects the shader', (): void => {
      const made = GPUDevice.prototype;
      // eslint-disable-next-line @typescript-eslint/unbound-method -- called on their devices below
      const { createShaderModule } = made;
      made.createShaderModule = function () {
        return createShaderModule.call(this, { code: 'fn walk(' });
      };
    }],
  ] as const) {
    it(`is drawn if ${name}`, async () => {
      const { page, faults } = await openPage(browsers.gpu, daemon.url);
      await page.addInitScript(lose);
      await page.goto(`${daemon.url}/#/volumes/${ball}?iso=100`);
      await page.locator('.live[data-size] .live-picture[data-still][data-painter=webgl2]').waitFor();
      expect(faults).toEqual([]);
      await page.close();
    });
  }
});
