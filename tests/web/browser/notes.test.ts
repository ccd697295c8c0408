// What the daemon says about an upload, and what a person may answer.
import { describe, expect } from 'vitest';
import { ctSlice, samples, seriesNifti, smallNrrd, twoFormNifti } from './files';
import { ballNrrd, cubeNrrd, drop, keepNotices, madeJob, noted, setup } from './support';

const { at, it } = setup();

// Would run if the page took a text for HTML; `faults` holds what the content policy blocks.
const hostile = '<img src=x onerror="document.title=1">';

async function expectText(text: string): Promise<void> {
  const { page } = at;
  await expect.poll(() => page.locator('body').innerText()).toContain(text);
  await expect.poll(() => page.locator('img[src=x]').count()).toBe(0);
  expect(await page.title()).not.toBe('1');
}

const volumePage = /#\/volumes\/[0-9a-f]{64}/;

// The queries of the uploads that the page sends from now on.
function uploadsOf(page: typeof at.page): string[] {
  const queries: string[] = [];
  page.on('request', (request) => {
    const url = new URL(request.url());
    if (request.method() === 'POST' && url.pathname === '/v1/volumes') queries.push(decodeURIComponent(url.search));
  });
  return queries;
}

describe('an upload of several volumes', () => {
  it('is answered for one by one, and what is refused can be tried again', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    const queries = uploadsOf(page);
    const hostileName = `${hostile}.nrrd`.replace('/', '');
    await drop(page, [
      { name: hostileName, bytes: smallNrrd() },
      { name: 'times.nii', bytes: seriesNifti() },
      { name: 'cut.nrrd', bytes: smallNrrd([], samples.subarray(0, 5)) },
      { name: 'readme.txt', bytes: Buffer.from('what this is') },
    ]);
    const rows = page.locator('.outcomes > li');
    await expect.poll(() => rows.count()).toBe(3);
    expect(await page.locator('.skipped').innerText()).toBe('1 file was skipped: readme.txt');
    await expectText(hostileName);
    await expect.poll(() => page.locator('.drop h2').innerText()).toBe('1 of 3 volumes in the upload were stored');
    await expect.poll(() => page.locator('[data-member="cut.nrrd"]').innerText()).toContain('truncated');
    await expect.poll(() => page.locator('[data-volume]').count()).toBe(1);

    const times = page.locator('[data-member="times.nii"]');
    expect(await times.innerText()).toContain('Which volume?');
    await times.getByRole('button', { name: 'time 1' }).click();
    await expect.poll(() => page.locator('.outcomes .stored').count()).toBe(2);
    const [kept = ''] = /upload=\w{32}/.exec(queries[1] ?? '') ?? [];
    expect(queries).toEqual(['?keep=true', `?keep=true&${kept}&member=times.nii&volume=1`]);
    await expect.poll(() => page.locator('[data-member="cut.nrrd"]').getAttribute('class')).toBe('refused');
    await expect.poll(() => page.locator('[data-volume]').count()).toBe(2);

    await times.getByRole('link').click();
    await page.waitForURL(volumePage);
    await expect.poll(() => page.locator('[data-note="volume-chosen"]').innerText()).toContain('Volume 1');
    await page.goto(daemon.url);
    await expectText(hostileName);
  });
});

describe('a refusal', () => {
  it('that a person may overrule is taken in spite of it, and says so', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    const queries = uploadsOf(page);
    // Two and two slices in one frame of reference.
    const slices = [1, 2, 3, 4].map((index) => ({
      name: `${index}.dcm`,
      bytes: ctSlice(index, index < 3 ? '1.9.1' : '1.9.2', hostile),
    }));
    await drop(page, slices);
    await page.getByRole('button', { name: 'Accept it anyway' }).click();
    await page.waitForURL(volumePage);
    const [kept = ''] = /upload=\w{32}/.exec(queries[1] ?? '') ?? [];
    expect(queries).toEqual(['?keep=true', `?keep=true&${kept}&accept=frame-of-reference`]);
    await expect.poll(() => page.locator('[data-note="frame-of-reference"]').count()).toBe(1);
    await expectText(hostile); // the series' name
  });
});

describe('notes and what was left out', () => {
  it('are shown as text, whatever a file holds', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    const fields = [
      'space: LPS',
      'space directions: (1,0,0) (0,1,0) (0,0,3)',
      'space units: "pixel" "pixel" "pixel"',
    ];
    await drop(page, [{ name: 'unit.nrrd', bytes: smallNrrd(fields) }]);
    await page.waitForURL(volumePage);
    await expect.poll(() => page.locator('[data-note="unit-unknown"]').innerText()).toContain('pixel');
    // Details repeat little of a file, and no page should rely on that.
    await page.route('**/v1/volumes/*', async (route) => {
      const answer = await route.fetch();
      const volume = (await answer.json()) as { notes: { code: string; detail: string }[] };
      volume.notes = [{ code: `"><${hostile}`, detail: hostile }];
      await route.fulfill({ response: answer, json: volume });
    });
    await page.reload();
    await expectText(hostile);
    await expect.poll(() => page.locator('.notes img').count()).toBe(0);
    await page.unroute('**/v1/volumes/*');

    await page.goto(daemon.url);
    const name = hostile.replace('/', '');
    await drop(page, [
      ...[1, 2].map((index) => ({ name: `${index}.dcm`, bytes: ctSlice(index, '1.9', 'one') })),
      { name, bytes: Buffer.from('no volume') },
    ]);
    await page.waitForURL(volumePage);
    const summary = page.locator('summary', { hasText: '1 file was skipped' });
    await summary.click();
    const id = new URL(page.url()).hash.split(/[/?]/)[2] ?? '';
    const { ignored } = await daemon.json<{ ignored: { name: string; reason: string }[] }>(`/v1/volumes/${id}`);
    expect(ignored).toHaveLength(1);
    expect(await summary.innerText()).toContain(ignored[0]?.name);
    await expectText(ignored[0]?.reason ?? '');
  });
});

describe('a volume', () => {
  it('that was there already says so, and what its file showed', async ({ daemon, page }) => {
    const fields = ['space: LPS', 'space directions: (1,0,0) (0,1,0) (0,0,4)'];
    const bytes = Buffer.concat([smallNrrd(fields), Buffer.from('more')]);
    const body = new Blob([new Uint8Array(bytes)]);
    const { notes } = await daemon.json<{ notes: { detail: string }[] }>('/v1/volumes', { method: 'POST', body });
    expect(notes).toHaveLength(1);
    await keepNotices(page);
    await page.goto(daemon.url);
    await drop(page, [{ name: 'longer.nrrd', bytes }]);
    await page.waitForURL(volumePage);
    await expect.poll(() => page.locator('.toast').innerText()).toContain(`already stored. ${notes[0]?.detail}`);
  });

  it('is renamed, by the button and by the Enter key, and keeps a name that is no HTML', async ({ daemon, page }) => {
    const id = await daemon.upload(smallNrrd(['spacings: 1 1 2']));
    const open = `${daemon.url}/#/volumes/${id}`;
    await page.goto(open);
    const rename = async (name: string, end: () => Promise<void>): Promise<void> => {
      await page.getByRole('button', { name: 'Rename' }).click();
      await page.getByLabel('Name of this volume').and(page.locator('input')).fill(name);
      await end();
      await expect.poll(() => page.locator('dialog').count()).toBe(0);
    };
    const byButton = (name: string) => () => page.locator('dialog').getByRole('button', { name }).click();
    const title = page.locator('h1 > span');
    const facts = await title.innerText();
    await rename('skull', byButton('Rename'));
    await expect.poll(() => title.innerText()).toBe('skull');
    await rename('head', byButton('Cancel'));
    await expect.poll(() => title.innerText()).toBe('skull');
    await rename(hostile, () => page.keyboard.press('Enter'));
    await expect.poll(() => title.innerText()).toBe(hostile);
    await page.reload();
    await expectText(hostile);
    await daemon.make({ volume: id, iso: 110, formats: ['stl'] });
    await page.goto(`${daemon.url}/#/`);
    await expect.poll(() => page.locator(`[data-volume="${id}"] strong`).getAttribute('title')).toBe(hostile);
    await expectText(hostile);
    await page.goto(`${daemon.url}/#/jobs`);
    await expectText(hostile);
    await page.goto(open);
    await rename('', byButton('Rename'));
    await expect.poll(() => title.innerText()).toBe(facts);
  });
});

describe('a NIfTI file with two forms', () => {
  it('can be read by the other one, and back', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    await drop(page, [{ name: 'forms.nii', bytes: twoFormNifti() }]);
    await page.waitForURL(volumePage);
    const [sform = ''] = volumePage.exec(page.url()) ?? [];
    const note = page.locator('[data-note="forms-differ"]');
    await expect.poll(() => note.innerText()).toContain('5.0 mm apart. The sform was used.');
    await note.getByRole('button', { name: 'Use the qform' }).click();
    await expect.poll(() => note.innerText()).toContain('The qform was used.');
    expect(page.url()).not.toContain(sform);
    await note.getByRole('button', { name: 'Use the sform' }).click();
    await expect.poll(() => page.url()).toContain(sform);
    // After the page has loaded anew it does not have the file.
    await page.reload();
    await expect.poll(() => note.innerText()).toContain('The sform was used.');
    expect(await note.getByRole('button').count()).toBe(0);
  });
});

describe('a volume that its file places wrongly', () => {
  it('is flipped and turned as a copy with a note, and back again', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    await drop(page, [{ name: 'flat.nrrd', bytes: smallNrrd() }]);
    await page.waitForURL(volumePage);
    const idOf = (): string => volumePage.exec(page.url())?.[0].split('/').pop() ?? '';
    const first = idOf();
    const change = async (name: string): Promise<{ stored_axes: string }> => {
      const before = idOf();
      await page.getByText('Is the volume placed wrongly?').click();
      await page.getByRole('button', { name }).click();
      await page.waitForURL((url) => volumePage.test(url.hash) && !url.hash.includes(before));
      return daemon.json(`/v1/volumes/${idOf()}`);
    };
    const flipped = await change('Flip left and right');
    expect(flipped.stored_axes).toBe('RPS');
    await expect.poll(() => page.locator('p.facts').innerText()).toContain('stored as RPS');
    const note = page.locator('[data-note="orientation-changed"]');
    await expect.poll(() => note.innerText()).toContain('-x,y,z');
    await change('Flip left and right');
    expect(idOf()).toBe(first);
    await expect.poll(() => note.count()).toBe(0);
    expect((await change('Turn in axial slices')).stored_axes).toBe('PRS');
    await expect.poll(() => note.innerText()).toContain('y,-x,z');
  });
});

describe('iso-values with names', () => {
  it('are there for what a person says is a CT, beside a person\'s own', async ({ daemon, page }) => {
    await page.goto(daemon.url);
    const values = new Int16Array(8 ** 3).map((_, n) => (n % 2 === 0 ? -1000 : 1000));
    const header = 'NRRD0004\ntype: int16\ndimension: 3\nsizes: 8 8 8\nspacings: 1 1 1\nendian: little\nencoding: raw\n\n';
    await drop(page, [{ name: 'unsaid.nrrd', bytes: Buffer.concat([Buffer.from(header), Buffer.from(values.buffer)]) }]);
    await page.waitForURL(volumePage);
    const presets = page.getByRole('group', { name: 'Presets' });
    expect(await presets.getByRole('button', { name: /^bone/ }).count()).toBe(0);
    const before = page.url();
    await page.getByRole('button', { name: 'This is a CT in Hounsfield units' }).click();
    await page.waitForURL((url) => volumePage.test(url.hash) && !before.startsWith(url.href.split('?')[0] ?? ''));
    await presets.getByRole('button', { name: /^bone/ }).click();
    await expect.poll(() => page.locator('.iso-input').inputValue()).toBe('250');
    await page.locator('.iso-input').fill('612');
    await presets.getByRole('button', { name: 'Save as preset' }).click();
    await page.getByRole('textbox', { name: 'Name for the iso-value 612' }).fill('cage');
    await page.keyboard.press('Enter');
    await presets.getByRole('button', { name: 'cage 612' }).waitFor();
    await page.locator('.iso-input').fill('5');
    await page.reload();
    await presets.getByRole('button', { name: 'cage 612' }).click();
    await expect.poll(() => page.locator('.iso-input').inputValue()).toBe('612');
    await presets.getByRole('button', { name: 'Remove the preset cage' }).click();
    await expect.poll(() => presets.getByRole('button', { name: 'cage 612' }).count()).toBe(0);
  });
});

// From an upload to the page of its job, at that iso-value.
async function makeOf(name: string, bytes: Buffer, iso: number): Promise<void> {
  const { daemon, page } = at;
  await page.goto(daemon.url);
  await drop(page, [{ name, bytes }]);
  await page.waitForURL(volumePage);
  await page.getByLabel('Iso-value', { exact: true }).nth(0).fill(String(iso));
  await expect.poll(() => noted(page, 'iso')).toBe(String(iso));
  await page.getByRole('button', { name: 'Make the surface' }).click();
  await page.waitForURL(/#\/jobs\//);
  await madeJob(at);
}

describe('what a job found', () => {
  it('is why its surface is empty, and what is not', async ({ page }) => {
    await makeOf('ball.nrrd', ballNrrd(20, 7, 4), 251);
    const overlay = page.locator('.overlay.message');
    await expect.poll(() => overlay.innerText()).toMatch(/The surface is empty: the iso-value 251 .*; its suggested iso-value is \d/);
    const [, suggested = ''] = /suggested iso-value is (\d+(\.\d+)?)/.exec(await overlay.innerText()) ?? [];
    await overlay.getByRole('link', { name: 'Change parameters' }).click();
    await page.waitForURL(volumePage);
    await page.getByLabel('Iso-value', { exact: true }).nth(0).fill(suggested);
    await expect.poll(() => noted(page, 'iso')).toBe(suggested);
    await page.getByRole('button', { name: 'Make the surface' }).click();
    await page.waitForURL(/#\/jobs\//);
    expect((await madeJob(at)).mesh?.triangles).toBeGreaterThan(0);
  });

  it('is a cavity that a thin wall leaves open', async ({ page }) => {
    const wall = cubeNrrd(30, (x, y, z) => (Math.abs(Math.hypot(x - 14.6, y - 14.3, z - 14.8) - 11) < 0.75 ? 200 : 7));
    await makeOf('wall.nrrd', wall, 100);
    const numbers = page.getByLabel('Job', { exact: true });
    await expect.poll(() => numbers.innerText()).toMatch(/Notes\s+1 cavity of \d+ voxels .* scheme=5 closes it\./);
  });
});
