// A daemon that takes few uploads at once: the page and the JavaScript client wait for it.
import { once } from 'node:events';
import { connect, type Socket } from 'node:net';
import { describe, expect } from 'vitest';
import { Client } from '../../../client/web/src/api/index';
import { ballNrrd, drop, setup, type Daemon } from './support';

const { alone } = setup();
const crowd = 12;
// Takes one upload of a client at a time, which is half of its places.
const few = ['--upload-places', '2'];

// Uploads without an end, until it is destroyed.
async function occupy({ url }: Daemon): Promise<Socket> {
  const socket = connect(Number(new URL(url).port), '127.0.0.1');
  socket.on('error', () => undefined); // the daemon may end before it
  socket.write('POST /v1/volumes HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 10000000\r\nExpect: 100-continue\r\n\r\n');
  const [answer] = (await once(socket, 'data')) as [Buffer];
  expect(answer.toString()).toContain(' 100 '); // it has the place
  return socket;
}

describe('the page', () => {
  for (const [how, size] of [['in one request', 64], ['in parts', 208]] as const) {
    alone(`says that the server is busy, and uploads ${how} when it is not`, async ({ page, daemon }) => {
      await page.goto(daemon.url);
      const other = await occupy(daemon);
      await drop(page, [{ name: 'ball.nrrd', bytes: ballNrrd(size, 20) }]);
      await expect.poll(() => page.locator('.upload-status').innerText()).toBe('The server is busy. The upload is tried again automatically');
      await expect.poll(() => page.locator('.banner').innerText()).toBe('The server is busy. The page tries again automatically.');
      expect(await page.locator('.refusal').count()).toBe(0);
      other.destroy();
      await page.waitForURL(/#\/volumes\/[0-9a-f]{64}/);
      await expect.poll(() => page.locator('.banner').isVisible()).toBe(false);
    }, few);
  }

  alone('ends its wait when a person cancels it', async ({ page, daemon }) => {
    await page.goto(daemon.url);
    const other = await occupy(daemon);
    await drop(page, [{ name: 'ball.nrrd', bytes: ballNrrd(64, 20) }]);
    await page.locator('.banner').waitFor();
    await page.getByRole('button', { name: 'Cancel' }).click();
    await page.getByRole('heading', { name: 'Drop a volume here' }).waitFor();
    await expect.poll(() => page.locator('.banner').isVisible()).toBe(false);
    other.destroy();
  }, few);
});

describe('many uploads at once', () => {
  alone('all arrive from Node', async ({ daemon }) => {
    const client = new Client({ server: daemon.url });
    const other = await occupy(daemon);
    let waits = 0;
    const onBusy = (): void => {
      waits += 1;
      other.destroy();
    };
    const uploads = Array.from({ length: crowd }, (_, number) => client.upload(ballNrrd(64, 20, number), { onBusy }));
    const ids = (await Promise.all(uploads)).map(({ volumes }) => volumes[0]?.volume?.id);
    expect(new Set(ids).size).toBe(crowd);
    expect(waits).toBeGreaterThan(0);
  }, few);
});
