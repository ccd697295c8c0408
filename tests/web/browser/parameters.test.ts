// The form of a job's parameters, and what of it reaches the job.
import { execFile, execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import type { Locator, Page } from 'playwright-core';
import { beforeAll, describe, expect } from 'vitest';
import { parameters } from '../../../client/web/src/job/table';
import { jobParameters, notInTheForm } from '../openapi';
import { ballNrrd, noted, setup, openedJob } from './support';

const { at, it } = setup();
let ball: string;

beforeAll(async () => {
  ball = await at.daemon.upload(ballNrrd(24, 8));
});

async function openForm(page: Page, query = ''): Promise<void> {
  await page.goto('about:blank');
  await page.goto(`${at.daemon.url}/#/volumes/${ball}?iso=100${query}`);
  await page.locator('.parameters summary').click();
}

function control(page: Page, name: string): Locator {
  return page.locator(`[data-parameter="${name}"]`);
}

async function make(page: Page): Promise<Record<string, unknown>> {
  await page.getByRole('button', { name: 'Make the surface' }).click();
  await page.waitForURL(/#\/jobs\//);
  return (await openedJob(at)).parameters;
}

function valueAt(job: Record<string, unknown>, name: string): unknown {
  return name.split('.').reduce<unknown>((value, part) => (value as Record<string, unknown>)[part], job);
}

// Values of parameters that are lists.
const lists: Readonly<Record<string, string>> = {
  'components.nearest_to': '1, 2, 3',
  lods: '1, 0.5',
};

// Chooses another value than the one that is there.
async function change(element: Locator): Promise<void> {
  if ((await element.getAttribute('data-parameter')) === 'crop') {
    await element.getByRole('checkbox').check();
    return;
  }
  const number = element.getByRole('spinbutton');
  if ((await number.count()) > 0) {
    const [low, high] = await Promise.all(['aria-valuemin', 'aria-valuemax'].map(async (bound) => Number(await number.getAttribute(bound))));
    const name = (await element.getAttribute('data-parameter')) ?? '';
    const isWhole = jobParameters.get(name)?.type?.includes('integer') ?? false;
    await number.fill(String(isWhole ? (low ?? 0) + 2 : (low ?? 0) + (high || 1) / 4));
    return;
  }
  const slider = element.locator('input[type=range]');
  if ((await slider.count()) > 0) {
    await slider.fill((await slider.getAttribute('max')) ?? '');
    return;
  }
  const list = element.locator('input[type=text]');
  if ((await list.count()) > 0) {
    const name = (await element.getAttribute('data-parameter')) ?? '';
    await list.fill(lists[name] ?? '');
    return;
  }
  // What another parameter brings with it.
  const [box] = await element.locator('input[type=checkbox]:disabled').all();
  if (box && (await element.evaluate((node) => node.matches('label'))) && (await box.isChecked())) return;
  // One box, a row of choices, or boxes; of several whichever is not on.
  const isOne = await element.evaluate((node) => node.matches('label'));
  if (isOne) {
    await element.click();
    return;
  }
  const labels = element.locator('label');
  for (const label of await labels.all()) {
    if (await label.locator('input').isChecked()) continue;
    await label.click();
    return;
  }
  throw new Error('every value is chosen');
}

describe('the kind of a surface', () => {
  it('is one of three, and sets the parameters behind it', async ({ page }) => {
    await page.goto('about:blank');
    await page.goto(`${at.daemon.url}/#/volumes/${ball}?iso=100`);
    const kind = (name: string): Locator => page.getByRole('radio', { name, exact: true });
    await expect.poll(() => kind('Smooth').isChecked()).toBe(true);
    expect(await control(page, 'passes').isVisible()).toBe(false);
    expect(await control(page, 'scheme').isVisible()).toBe(false);
    await kind('As scanned').check({ force: true });
    await expect.poll(() => noted(page, 'passes')).toBe('0');
    await kind('For printing').check({ force: true });
    await expect.poll(() => kind('For printing').isChecked()).toBe(true);
    await expect.poll(() => page.locator('.estimate dd').first().innerText()).toMatch(/^\d.* before simplification$/);
    const job = await make(page);
    expect(job).toMatchObject({ close: true, certify: true, passes: 5 });
    expect(job['formats']).toEqual(expect.arrayContaining(['glb', 'stl', '3mf']));
  });
});

describe('the form', () => {
  it('shows each parameter of the schema, and what is set there reaches the job', async ({ page }) => {
    // With Taubin's smoothing, for which all of them are.
    await openForm(page, '&smoothing=taubin');
    const names = [...jobParameters.keys()].filter((name) => !notInTheForm.includes(name));
    expect(names.length).toBeGreaterThan(13);
    for (const name of names) {
      const element = control(page, name);
      await expect.poll(() => element.count(), { message: name }).toBe(1);
      await expect.poll(() => element.isVisible(), { message: name }).toBe(true);
      expect(await element.getAttribute('title'), name).not.toBe('');
      if (name !== 'smoothing') await change(element);
    }
    const job = await make(page);
    for (const name of names) {
      expect(valueAt(job, name), name).not.toEqual(jobParameters.get(name)?.default);
    }
    // It says how to do the same without the page, with options that the command has.
    const said = await page.locator('.snippet pre').first().textContent();
    const isomesh = join(dirname(process.env.ISOMESHD ?? ''), 'isomesh');
    const help = execFileSync(isomesh, ['submit', '--help']).toString();
    for (const { name, option } of parameters.filter((parameter) => names.includes(parameter.name))) {
      expect(said, name).toMatch(new RegExp(`--(no-)?${option}\\b`));
      expect(help, name).toMatch(new RegExp(`--${option}\\b`));
    }
  });
});

describe('the text that repeats a job', () => {
  it('runs as Python and as JavaScript, and gives the same mesh', async ({ daemon, page }) => {
    const { id } = await daemon.make({ volume: ball, iso: 100, lambda: 0.5, close: true, crop: null, formats: ['stl'] });
    await page.goto('about:blank');
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    const said = async (name: string): Promise<string> => (await page.locator('.snippet', { has: page.locator('summary', { hasText: name }) }).locator('pre').textContent()) ?? '';
    const mesh = Buffer.from(await (await fetch(`${daemon.url}/v1/jobs/${id}/mesh.stl`)).arrayBuffer());
    const folder = mkdtempSync(join(tmpdir(), 'isomesh-repeat-'));
    const repeated = async (program: string, file: string, text: string, env: NodeJS.ProcessEnv): Promise<void> => {
      writeFileSync(join(folder, file), text);
      await promisify(execFile)(program, [file], { cwd: folder, env: { ...process.env, ...env } });
      expect(readFileSync(join(folder, 'mesh.stl')).equals(mesh), file).toBe(true);
      rmSync(join(folder, 'mesh.stl'));
    };
    try {
      await repeated('python3', 'repeat.py', await said('Python'), { PYTHONPATH: fileURLToPath(new URL('../../../client/python/src', import.meta.url)) });
      const own = join(folder, 'node_modules/isomesh');
      mkdirSync(own, { recursive: true });
      writeFileSync(join(own, 'package.json'), '{"type":"module","exports":"./client.js"}');
      writeFileSync(join(own, 'client.js'), await (await fetch(`${daemon.url}/client.js`)).text());
      await repeated(process.execPath, 'repeat.mjs', await said('JavaScript'), {});
    } finally {
      rmSync(folder, { recursive: true });
    }
  });
});

describe('the kind of smoothing', () => {
  // Through the link that takes over the parameters of a job, whose answer names its step.
  const change = async (from: string, to: string): Promise<Record<string, unknown>> => {
    const { page, daemon } = at;
    const { id } = await daemon.make({ volume: ball, iso: 100, smoothing: from, formats: ['glb'] });
    await page.goto('about:blank');
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await page.getByRole('link', { name: 'Change parameters' }).click();
    await page.locator('.parameters summary').click();
    await control(page, 'smoothing').getByLabel(to).check();
    return make(page);
  };

  it('is switched without the step of the other', async () => {
    expect(await change('laplacian', 'Taubin')).toMatchObject({ smoothing: 'taubin', lambda: 0.33 });
    expect(await change('taubin', 'Laplacian')).toMatchObject({ smoothing: 'laplacian', lambda: 1 });
  });

  it('shows which step is taken, and has a pass band only where it is used', async ({ page }) => {
    await openForm(page, '&smoothing=taubin&lambda=0.5&pass_band=0.2');
    const lambda = control(page, 'lambda').locator('input');
    const band = control(page, 'pass_band').locator('input');
    expect([await lambda.inputValue(), await band.inputValue()]).toEqual(['0.5', '0.2']);
    await control(page, 'smoothing').getByLabel('Laplacian').check();
    expect([await lambda.inputValue(), await lambda.getAttribute('placeholder')]).toEqual(['', '1']);
    await expect.poll(() => band.isDisabled()).toBe(true);
    await control(page, 'smoothing').getByLabel('Taubin').check();
    expect([await lambda.inputValue(), await lambda.getAttribute('placeholder')]).toEqual(['', '0.33']);
    expect([await band.inputValue(), await band.isDisabled()]).toEqual(['0.1', false]);
  });
});
