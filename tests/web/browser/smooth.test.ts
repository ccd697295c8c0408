// The page never waits for its shaders: a program is asked for only after a fence behind its linking has passed. A page that
// asks sooner stands still until it is made, 0.2 s and more where software draws.
import { expect } from 'vitest';
import { ballNrrd, openSurface, setup, still } from './support';

const { at, it } = setup();

interface Watched {
  linked: number;
  // Programs that were asked for too soon.
  tooSoon: number;
}

it('the page does not wait for shaders while a surface comes and is looked at', async ({ page, daemon }) => {
  const volume = await daemon.upload(ballNrrd(48, 18));
  const job = await daemon.make({ volume, iso: 100, formats: ['glb'] });
  await page.addInitScript(() => {
    const watched: Watched = { linked: 0, tooSoon: 0 };
    Object.assign(window, { watched });
    const made = WebGL2RenderingContext.prototype;
    let now = 0;
    let passed = 0;
    const links = new WeakMap<WebGLProgram, number>();
    const fences = new WeakMap<WebGLSync, number>();

    // eslint-disable-next-line @typescript-eslint/unbound-method -- called on their contexts below
    const { linkProgram, fenceSync, clientWaitSync, getProgramParameter } = made;

    made.linkProgram = function (program) {
      links.set(program, (now += 1));
      watched.linked += 1;
      linkProgram.call(this, program);
    };
    made.fenceSync = function (condition, flags) {
      const fence = fenceSync.call(this, condition, flags);
      if (fence) fences.set(fence, (now += 1));
      return fence;
    };
    made.clientWaitSync = function (fence, flags, timeout) {
      const state = clientWaitSync.call(this, fence, flags, timeout);
      if (state !== this.TIMEOUT_EXPIRED) passed = Math.max(passed, fences.get(fence) ?? 0);
      return state;
    };
    made.getProgramParameter = function (program, name) {
      const completion = 0x91b1; // which does not wait
      if (name !== completion && (links.get(program) ?? 0) > passed) watched.tooSoon += 1;
      return getProgramParameter.call(this, program, name) as unknown;
    };
  });
  const watched = (): Promise<Watched> => page.evaluate(() => (window as unknown as { watched: Watched }).watched);
  await openSurface(at, job.id);
  expect(await watched()).toMatchObject({ linked: expect.any(Number) as number, tooSoon: 0 });
  expect((await watched()).linked).toBeGreaterThan(2);
  for (const key of ['t', 't', 'w', 'w']) {
    await page.keyboard.press(key);
    await still(page);
  }
  expect((await watched()).tooSoon).toBe(0);
});
