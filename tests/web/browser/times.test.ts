// How long the page takes, of a real volume; for who sets ISOMESH_TIMES, on a machine that has nothing else to do. Prints what it
// measured, and puts a drag of the iso-value, as a row of pictures with their times, into the folder that ISOMESH_TIMES names.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { CDPSession, Page } from 'playwright-core';
import { expect } from 'vitest';
import { ballNrrd, head, setup, still, surfaceLoaded } from './support';

const { at, it } = setup({ viewport: { width: 1280, height: 800 } });
const folder = process.env.ISOMESH_TIMES ?? '';

interface Times {
  // In milliseconds from when the page was opened.
  first: number;
  whole: number;
  // Those that took more than 50 ms.
  tasks: { began: number; took: number }[];
}

function say(what: string, value: string): void {
  process.stdout.write(`${what}: ${value}\n`);
}

async function uploadHead(): Promise<string> {
  const body = new Blob([new Uint8Array(readFileSync(head))]);
  return (await at.daemon.json<{ id: string }>('/v1/volumes', { method: 'POST', body })).id;
}

// Watches from the page's first moment on, without asking it anything meanwhile.
async function watch(page: Page): Promise<void> {
  await page.addInitScript(() => {
    const times: Times = { first: 0, whole: 0, tasks: [] };
    Object.assign(window, { times });
    new PerformanceObserver((list) => {
      for (const { startTime, duration } of list.getEntries()) times.tasks.push({ began: startTime, took: duration });
    }).observe({ type: 'longtask', buffered: true });
    const made = WebGL2RenderingContext.prototype;
    // eslint-disable-next-line @typescript-eslint/unbound-method -- called on their contexts below
    const { drawElements } = made;
    made.drawElements = function (mode, count, type, offset) {
      drawElements.call(this, mode, count, type, offset);
      // What is around the surface has a few dozen triangles.
      if (times.first === 0 && mode === this.TRIANGLES && count > 3000) {
        requestAnimationFrame(() => (times.first ||= performance.now()));
      }
    };
    new MutationObserver(() => {
      if (times.whole === 0 && document.querySelector('.pane[data-loaded]')) times.whole = performance.now();
    }).observe(document, { subtree: true, childList: true, attributes: true, attributeFilter: ['data-loaded'] });
  });
}

function timesOf(page: Page): Promise<Times> {
  return page.evaluate(() => (window as unknown as { times: Times }).times);
}

// Until the first triangles the browser starts its drawing, for which the page waits once.
function told({ tasks, first }: Times): string {
  const of = (some: Times['tasks']): string =>
    `${some.length} tasks above 50 ms, the longest ${Math.round(Math.max(0, ...some.map(({ took }) => took)))} ms`;
  return `before: ${of(tasks.filter(({ began }) => began < first))}; after: ${of(tasks.filter(({ began }) => began >= first))}`;
}

async function heapOf(session: CDPSession): Promise<number> {
  await session.send('HeapProfiler.collectGarbage');
  const { usedSize } = await session.send('Runtime.getHeapUsage');
  return usedSize / (1 << 20);
}

it('a surface of millions of triangles', async ({ daemon, browser }) => {
  const volume = await uploadHead();
  const job = await daemon.make({ volume, iso: 60, regularize: false, formats: ['glb'] });
  const seen: Times[] = [];
  for (let run = 0; run < 3; run += 1) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
    const page = await context.newPage();
    await watch(page);
    await page.goto(`${daemon.url}/#/jobs/${job.id}`);
    await surfaceLoaded(page);
    seen.push(await timesOf(page));
    await context.close();
  }
  seen.sort((a, b) => a.whole - b.whole);
  for (const times of seen) {
    const { first, whole } = times;
    say('ch2 at 60, from a cold page', `first triangles ${Math.round(first)} ms, all ${Math.round(whole)} ms, ${told(times)}`);
  }
  expect(seen.every(({ first, whole }) => first > 0 && first < whole)).toBe(true);
});

// Of the surface in that pane, which a drag turns for so many seconds.
async function framesTurning(page: Page, seconds: number): Promise<number> {
  const viewport = page.locator('.viewport');
  const box = await viewport.boundingBox();
  if (!box) throw new Error('there is no surface');
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const frames = (): Promise<number> => viewport.evaluate(({ dataset }) => Number(dataset.frames ?? 0));
  const turn = async (milliseconds: number): Promise<void> => {
    const began = performance.now();
    while (performance.now() < began + milliseconds) {
      const angle = (performance.now() - began) / 300;
      await page.mouse.move(x + 150 * Math.sin(angle), y + 40 * Math.cos(angle));
    }
  };
  await page.mouse.move(x, y);
  await page.mouse.down();
  // Until then it finds out how much effort there is time for.
  await turn(3000);
  const before = await frames();
  await turn(1000 * seconds);
  const drawn = (await frames()) - before;
  await page.mouse.up();
  return drawn / seconds;
}

it('a surface of millions of triangles that is turned', async ({ page, daemon }) => {
  const volume = await uploadHead();
  const { id, mesh } = await daemon.make({ volume, iso: 60, regularize: false, formats: ['glb'] });
  await page.goto(`${daemon.url}/#/jobs/${id}`);
  await surfaceLoaded(page);
  for (let run = 0; run < 3; run += 1) {
    const rate = await framesTurning(page, 5);
    await still(page);
    const { effort = '' } = await page.locator('.viewport').evaluate(({ dataset }) => ({ effort: dataset.effort }));
    say(`${mesh?.triangles ?? 0} triangles while they are turned`, `${rate.toFixed(1)} frames a second, ${effort}`);
    expect(rate).toBeGreaterThan(0);
  }
});

it('twenty surfaces, one after the other', async ({ page, daemon }) => {
  const volume = await daemon.upload(ballNrrd(96, 40));
  const session = await page.context().newCDPSession(page);
  const heap: number[] = [];
  for (let count = 0; count <= 20; count += 1) {
    const job = await daemon.make({ volume, iso: 90 + count, formats: ['glb'] });
    await page.goto(`${daemon.url}/#/jobs/${job.id}`);
    await surfaceLoaded(page);
    if (count === 1 || count === 20) heap.push(await heapOf(session));
  }
  say('heap after 1 and after 20 surfaces', heap.map((mebibytes) => `${mebibytes.toFixed(1)} MiB`).join(', '));
  expect(heap).toHaveLength(2);
});

it('a drag of the iso-value', async ({ page, daemon }) => {
  const volume = await uploadHead();
  await page.goto(`${daemon.url}/#/volumes/${volume}?iso=60`);
  const live = page.locator('.live');
  await expect.poll(async () => Number(await live.getAttribute('data-size'))).toBeGreaterThan(64);
  await expect.poll(() => live.locator('.live-picture[data-still]').count()).toBe(1);
  const line = await page.locator('.histogram').boundingBox();
  const box = await live.boundingBox();
  if (!line || !box) throw new Error('the page has no histogram or no surface beside it');
  // How long after the last move a picture of that value was drawn.
  await page.evaluate(() => {
    const drawn = { moved: 0, took: [] as number[] };
    Object.assign(window, { drawn });
    window.addEventListener('pointermove', () => (drawn.moved = performance.now()), true);
    const cell = document.querySelector('.live');
    if (!cell) throw new Error('there is no surface');
    new MutationObserver(() => {
      if (drawn.moved > 0) drawn.took.push(performance.now() - drawn.moved);
      drawn.moved = 0;
    }).observe(cell, { attributes: true, attributeFilter: ['data-moving', 'data-resting'] });
  });
  const took = (): Promise<number[]> => page.evaluate(() => (window as unknown as { drawn: { took: number[] } }).drawn.took);
  await page.mouse.move(line.x + 0.2 * line.width, line.y + 30);
  await page.mouse.down();
  const pictures: string[] = [];
  for (let step = 1; step <= 60; step += 1) {
    await page.mouse.move(line.x + (0.2 + 0.01 * step) * line.width, line.y + 30);
    await page.waitForTimeout(100);
    if (step % 10 !== 0) continue;
    const iso = await live.getAttribute('data-iso');
    const shot = await page.screenshot({ clip: box });
    pictures.push(
      `<figure><img src="data:image/png;base64,${shot.toString('base64')}"><figcaption>iso ${Number(iso).toFixed(0)}, ` +
        `${Math.round((await took()).at(-1) ?? 0)} ms after the move</figcaption></figure>`,
    );
  }
  await page.mouse.up();
  const times = (await took()).sort((a, b) => a - b);
  say(
    'ms from a move of the line to a picture',
    `${times.length} pictures, ${[0, 0.5, 0.95, 1].map((part) => Math.round(times[Math.floor(part * (times.length - 1))] ?? 0)).join(', ')} (least, middle, 95 of 100, most)`,
  );
  expect(times.length).toBeGreaterThan(10);
  const sheet = await at.browser.newPage({ viewport: { width: 1260, height: 192 } });
  await sheet.setContent(
    `<style>body{display:grid;grid-template-columns:repeat(6,1fr);gap:6px;margin:6px;font:12px sans-serif}figure{margin:0}img{width:100%}</style>${pictures.join('')}`,
  );
  writeFileSync(join(folder, 'drag.png'), await sheet.locator('body').screenshot());
  await sheet.close();
});

// The processor's time of the page's thread: others may use the machine. The server has few jobs, of which the page is told many.
it('a list of three hundred jobs that is scrolled', async ({ daemon, page }) => {
  const volume = await daemon.upload(ballNrrd(16, 5));
  const job = await daemon.make({ volume, iso: 100, formats: ['stl'] });
  const jobs = Array.from({ length: 300 }, (_, at) => ({ ...job, id: `${job.id.slice(0, -3)}${at + 100}` }));
  await page.route(({ pathname }) => pathname === '/v1/jobs', (route) => {
    const isAll = !new URL(route.request().url()).searchParams.has('state');
    return route.fulfill({ json: { jobs: isAll ? jobs : [], next: null } });
  });
  await page.goto(`${daemon.url}/#/jobs`);
  await expect.poll(() => page.locator('.jobs tbody tr').count()).toBe(300);
  const session = await page.context().newCDPSession(page);
  await session.send('Performance.enable', { timeDomain: 'threadTicks' });
  const spent = async (): Promise<number> => {
    const { metrics } = await session.send('Performance.getMetrics');
    return 1000 * (metrics.find(({ name }) => name === 'TaskDuration')?.value ?? NaN);
  };
  const frames = 150;
  const before = await spent();
  const end = await page.locator('main').evaluate(async (main, count) => {
    for (let frame = 0; frame < count; frame += 1) {
      main.scrollTop += 60;
      await new Promise(requestAnimationFrame);
    }
    return main.scrollTop;
  }, frames);
  const each = ((await spent()) - before) / frames;
  say('ms of the processor for a frame of a list of 300 jobs', each.toFixed(1));
  expect(end).toBeGreaterThan(3000);
  expect(each).toBeLessThan(16);
});
