// The page stays responsive while a surface of a million triangles comes and while it is looked at.
import { readFileSync } from 'node:fs';
import { expect, it } from 'vitest';
import { brain, brainHull, setup, surfaceLoaded, still } from './support';

const at = setup();
const most = 100; // milliseconds, on a machine that does nothing else
const usualLoop = 60;

interface Watched {
  tasks: { begin: number; took: number }[];
  contexts: { begin: number; took: number }[];
}

// What the browser takes for a first context of its graphics processor is not the page's.
function ownTime({ begin, took }: Watched['tasks'][number], contexts: Watched['contexts']): number {
  const inIt = contexts.filter((each) => each.begin >= begin && each.begin < begin + took);
  return took - inIt.reduce((sum, each) => sum + each.took, 0);
}

it('no task takes longer than a tenth of a second', async () => {
  const { page, daemon } = at;
  const volume = await daemon.upload(readFileSync(brain));
  const job = await daemon.submit({ volume, iso: brainHull, formats: ['glb'] }, 30);
  await page.addInitScript(() => {
    const watched: Watched = { tasks: [], contexts: [] };
    Object.assign(window, { watched });
    new PerformanceObserver((list) => {
      for (const { startTime, duration } of list.getEntries()) watched.tasks.push({ begin: startTime, took: duration });
    }).observe({ type: 'longtask', buffered: true });
    // eslint-disable-next-line @typescript-eslint/unbound-method -- called on the canvas below
    const usual = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, ...given: unknown[]) {
      const begin = performance.now();
      const context: unknown = Reflect.apply(usual, this, given);
      watched.contexts.push({ begin, took: performance.now() - begin });
      return context;
    } as typeof usual;
  });
  // How much slower this machine is, with all that it does besides, than where the limit was measured.
  const loop = (): Promise<number> =>
    page.evaluate(() => {
      const began = performance.now();
      let sum = 0;
      for (let i = 0; i < 30_000_000; i += 1) sum = (sum + i * i) % 1_000_003;
      return performance.now() - began + 0 * sum;
    });
  const watched = (): Promise<Watched> => page.evaluate(() => (window as unknown as { watched: Watched }).watched);
  await page.goto(`${daemon.url}/#/jobs/${job.id}`);
  await surfaceLoaded(page);
  const loading = await watched();
  const slowness = Math.max(1, (await loop()) / usualLoop, (await loop()) / usualLoop);
  await page.goto('about:blank');
  await page.goto(`${daemon.url}/#/jobs/${job.id}`);
  await surfaceLoaded(page);
  await page.evaluate(() => (window as unknown as { watched: Watched }).watched.tasks.splice(0));
  for (const key of ['t', 't', 'w', 'w', 'c', 'c', 'a']) {
    await page.keyboard.press(key);
    await still(page);
  }
  const looking = await watched();
  const longest = ({ tasks, contexts }: Watched): number => Math.max(0, ...tasks.map((task) => ownTime(task, contexts)));
  expect(longest(loading)).toBeLessThan(most * slowness);
  expect(longest(looking)).toBeLessThan(most * slowness);
});
