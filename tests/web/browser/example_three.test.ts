// The page of examples/three, served by a server of its own, which the daemon allows as an origin.
import { createServer, type Server } from 'node:http';
import { readFileSync } from 'node:fs';
import { extname, join, normalize } from 'node:path';
import type { AddressInfo } from 'node:net';
import { fileURLToPath } from 'node:url';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Browser } from 'playwright-core';
import { ballNrrd, Daemon, slowest, startBrowser } from './support';

const here = (path: string): string => fileURLToPath(new URL(path, import.meta.url));
const example = here('../../../examples/three');
// The example asks for the same three.js.
const modules = here('../../../client/web/node_modules');
const types: Record<string, string> = {
  '.html': 'text/html',
  '.js': 'text/javascript',
  '.wasm': 'application/wasm',
};

function serveExample(): Promise<Server> {
  const server = createServer((request, response) => {
    const path = normalize(new URL(request.url ?? '/', 'http://localhost').pathname);
    const file = path.startsWith('/node_modules/')
      ? join(modules, path.slice('/node_modules'.length))
      : join(example, path === '/' ? 'index.html' : path);
    try {
      const bytes = readFileSync(file);
      response.setHeader('Content-Type', types[extname(file)] ?? 'application/octet-stream');
      response.end(bytes);
    } catch {
      response.statusCode = 404;
      response.end();
    }
  });
  return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve(server)));
}

describe('examples/three', () => {
  let server: Server;
  let browser: Browser;
  let daemon: Daemon;
  let origin: string;

  beforeAll(async () => {
    server = await serveExample();
    origin = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
    browser = await startBrowser();
    daemon = await Daemon.start(undefined, '127.0.0.1:0', ['--cors-origin', origin]);
  });
  afterAll(async () => {
    await browser?.close();
    await daemon?.remove();
    server?.close();
  });

  it('shows the surface of a volume that is chosen, and says why there is none', async () => {
    const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
    page.setDefaultTimeout(slowest);
    const faults: string[] = [];
    page.on('pageerror', (error) => faults.push(String(error)));
    page.on('requestfailed', (request) => faults.push(request.url()));
    await page.goto(`${origin}/?server=${encodeURIComponent(daemon.url)}`);
    const output = page.locator('output');
    const choose = async (name: string, buffer: Buffer): Promise<void> => {
      await page.setInputFiles('input[type=file]', { name, mimeType: 'application/octet-stream', buffer });
      await page.fill('input[name=iso]', '100');
      await page.click('button');
    };
    await choose('ball.nrrd', ballNrrd(32, 10));
    await expect.poll(() => output.textContent()).toMatch(/^\d{3,} triangles, \d+ x \d+ x \d+ mm$/);
    const job = await daemon.json<{ jobs: { mesh: { triangles: number } }[] }>('/v1/jobs');
    const [triangles] = ((await output.textContent()) ?? '').split(' ');
    expect(Number(triangles)).toBe(job.jobs[0]?.mesh.triangles);
    // The middle of the picture is the ball, its corner is not, and the ball's shades are many: it is
    // not drawn flat.
    const picture = await page.locator('canvas').screenshot();
    expect(picture.length).toBeGreaterThan(3000);
    await choose('notes.txt', Buffer.from('no volume'));
    await expect.poll(() => output.textContent()).toContain('not NIfTI');
    expect(faults).toEqual([]);
    await page.close();
  });
});
