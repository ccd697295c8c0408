// Runs the page as its README tells, in Chromium: node check.mjs [PICTURE]. ISOMESHD and CHROMIUM are the paths of the programs.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { chromium } from 'playwright-core';
import { serve } from './serve.mjs';

const { ISOMESHD: isomeshd = 'isomeshd', CHROMIUM: executablePath = '/usr/bin/chromium' } = process.env;
const templates = '/usr/share/mricron/templates';
const segments = 30;
const slowest = 180_000;

const folder = mkdtempSync(join(tmpdir(), 'isomesh-cornerstone-'));
const segmentation = join(folder, 'aal30.nii.gz');
execFileSync('node', ['keep_labels.mjs', `${templates}/aal.nii.gz`, String(segments), segmentation], { cwd: import.meta.dirname });
const pages = await serve(0);
const origin = `http://127.0.0.1:${pages.address().port}`;
const options = ['--listen', '127.0.0.1:0', '--data', join(folder, 'data'), '--log-level', 'error', '--cors-origin', origin];
const daemon = spawn(isomeshd, options, { stdio: ['ignore', 'pipe', 'inherit'] });
const browser = await chromium.launch({ executablePath, args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'] });

// The number of a figure with its unit.
const numberIn = (text) => Number.parseFloat(text);

try {
  const [line] = await new Promise((resolve, reject) => {
    createInterface({ input: daemon.stdout }).once('line', (text) => resolve([text]));
    daemon.once('error', reject);
    daemon.once('exit', (status) => reject(new Error(`the daemon ended with ${status}`)));
  });
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(slowest);
  const faults = [];
  page.on('pageerror', (error) => faults.push(error.stack));
  page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
  await page.goto(`${origin}/?server=${encodeURIComponent(line.replace('listening on ', ''))}`);
  await page.setInputFiles('input[name=image]', `${templates}/ch2.nii.gz`);
  await page.setInputFiles('input[name=segmentation]', segmentation);
  await page.click('button');
  const ended = page.waitForFunction(() => !/^$|\.\.\.$/.test(document.querySelector('output').textContent), null, { timeout: slowest });
  await ended.catch(() => undefined); // the assertions below say why
  if (process.argv[2]) await page.screenshot({ path: process.argv[2] });
  assert.equal(await page.locator('output').textContent(), 'Done.', faults.join('\n'));
  assert.deepEqual(faults, []);
  for (const row of await page.locator('tbody tr').all()) {
    const [name] = await row.locator('th').allTextContents();
    const cells = await row.locator('td').allTextContents();
    console.log([name, ...cells].join(', '));
    const [found, triangles, , , , off] = cells.map(numberIn);
    assert.equal(found, segments, name);
    assert.ok(triangles > 10_000, name);
    assert.ok(off < 1, `${name} lies ${off} mm beside the segmentation`);
  }
  assert.equal(await page.locator('tbody tr').count(), 2);
} finally {
  await browser.close();
  daemon.kill();
  pages.close();
  rmSync(folder, { recursive: true });
}
