// A hospital's orders, before a PACS that says what the test wants it to.
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect } from 'vitest';
import { Daemon, openPage, setup } from './support';

const { at, it } = setup();
let pacs: Server;
let folder: string;
let hospital: Daemon;
let status = 503;
const searched: URLSearchParams[] = [];

// Two series of one study, if it answers at all.
function found(path: string): unknown[] {
  const told = (vr: string, value: unknown): unknown => ({ vr, Value: [value] });
  if (/\/studies$/.test(path)) {
    const name = { Alphabetic: 'Doe^<b>Jane</b>' };
    return [{ '0020000D': told('UI', '1.2.7'), '00080020': told('DA', '20261130'), '00100010': told('PN', name), '00100020': told('LO', 'PAT-1'), '00081030': told('LO', 'Head') }];
  }
  return ['scout', 'bone 1 mm'].map((text, number) => ({
    '0020000E': told('UI', `1.2.7.${number}`),
    '00080060': told('CS', 'CT'),
    '0008103E': told('LO', text),
    '00201209': told('IS', 54 + number),
  }));
}

beforeAll(async () => {
  pacs = createServer(({ url = '' }, answer) => {
    const { pathname, searchParams } = new URL(url, 'http://pacs');
    if (/\/studies$/.test(pathname)) searched.push(searchParams);
    answer.writeHead(status, { 'Content-Type': 'application/json' }).end(JSON.stringify(status === 200 ? found(pathname) : []));
  });
  await new Promise<void>((resolve) => pacs.listen(0, '127.0.0.1', resolve));
  folder = mkdtempSync(join(tmpdir(), 'isomesh-hospital-'));
  const file = join(folder, 'hospital.toml');
  const { port } = pacs.address() as AddressInfo;
  writeFileSync(
    file,
    `[orders]\nsettle-seconds = 0\npoll-seconds = 1\nfirst-delay-seconds = 20\n[[pacs]]\nname = "main"\n` +
      `dicomweb = "http://127.0.0.1:${port}/dicom-web"\n[[rules]]\nname = "bone"\nparameters = { iso = 500 }\n` +
      'send = [ { pacs = "main" } ]\n',
  );
  hospital = await Daemon.start(undefined, '127.0.0.1:0', ['--hospital', file]);
});

afterAll(async () => {
  await hospital?.remove();
  pacs?.close();
  rmSync(folder, { recursive: true });
});

function order(series: string): Promise<{ id: string }> {
  const body = JSON.stringify({ source: { pacs: 'main', study: '1.2.3', series }, rule: 'bone' });
  return hospital.json('/v1/orders', { method: 'POST', body });
}

describe('orders', () => {
  it('are listed with what waits, why and until when, and can be cancelled and tried anew', async () => {
    const { page, faults } = await openPage(at.browser, hospital.url);
    await page.goto(hospital.url);
    await page.getByRole('link', { name: 'Orders', exact: true }).click();
    await expect.poll(() => page.locator('.queue-body').innerText()).toContain('No orders yet');
    status = 503;
    const { id: waiting } = await order('1.2.3.4');
    const row = page.locator(`tr[data-order="${waiting}"]`);
    await expect.poll(() => row.innerText()).toMatch(/waiting[^]*503[^]*\d+ attempts? failed[^]*next attempt (in \d+ s|now)[^]*main[^]*1\.2\.3\.4[^]*bone/);
    await expect.poll(() => page.locator('[data-pacs=main]').innerText()).toMatch(/last request failed/);
    await row.getByRole('button', { name: /Cancel/ }).click();
    await expect.poll(() => row.locator('td').first().innerText()).toBe('cancelled');
    await expect.poll(() => row.getByRole('button').count()).toBe(0);

    // One that is placed on the page; a rule that there is not is refused in place.
    await page.getByText('New order').click();
    for (const [name, text] of [['Study Instance UID', '1.2.3'], ['Series Instance UID', '1.2.3.9'], ['Rule', 'none']] as const) await page.getByLabel(name).fill(text);
    await page.getByRole('button', { name: 'Place the order' }).click();
    await expect.poll(() => page.getByRole('alert').innerText()).toContain('rule: is not configured');
    await page.getByLabel('Rule').fill('bone');
    await page.getByRole('button', { name: 'Place the order' }).click();
    await expect.poll(() => page.locator('tr[data-order]', { hasText: '1.2.3.9' }).innerText()).toMatch(/waiting[^]*bone/);

    status = 400;
    const { id: failed } = await order('1.2.3.5');
    const other = page.locator(`tr[data-order="${failed}"]`);
    await expect.poll(() => other.locator('td').first().innerText()).toBe('failed');
    await expect.poll(() => other.innerText()).toContain('400');
    await page.getByLabel('State').selectOption('failed');
    await expect.poll(() => page.locator('tr[data-order]').count()).toBe(1);
    await page.reload();
    await expect.poll(() => page.locator('tr[data-order]').count()).toBe(1);
    status = 503;
    await other.getByRole('button', { name: /Retry/ }).click();
    await expect.poll(() => page.locator('.queue-body').innerText()).toContain('No orders are failed');
    await page.getByLabel('State').selectOption('waiting');
    await expect.poll(() => other.innerText()).toContain('next attempt');
    await page.close();
    expect(faults).toEqual([]);
  });

  it('are placed for a series that a search of the PACS finds', async () => {
    const { page, faults } = await openPage(at.browser, hospital.url);
    await page.goto(`${hospital.url}/#/orders`);
    await page.getByText('New order').click();
    await page.getByRole('button', { name: 'Search' }).click();
    await expect.poll(() => page.getByRole('alert').innerText()).toContain('a search needs a patient');
    status = 503;
    await page.getByLabel('Patient name').fill('doe, j');
    await page.getByLabel('From').fill('2026-11-01');
    await page.getByLabel('Modality').fill('ct');
    await page.keyboard.press('Enter');
    await expect.poll(() => page.getByRole('alert').innerText()).toContain('503');
    status = 200;
    await page.keyboard.press('Enter');
    const rows = page.locator('tr[data-series]');
    await expect.poll(() => rows.count()).toBe(2);
    expect(await page.locator('details.more [role=status]').innerText()).toBe('2 series.');
    expect(await rows.nth(1).locator('td').allInnerTexts()).toEqual(['Doe <b>Jane</b> PAT-1', '2026-11-30', 'Head, bone 1 mm', 'CT', '55 images', 'Choose']);
    expect(['PatientName', 'StudyDate', 'ModalitiesInStudy', 'PatientID'].map((name) => searched.at(-1)?.get(name))).toEqual(['doe*j*', '20261101-', 'CT', null]);
    status = 503; // the order waits
    await page.getByRole('button', { name: /^Choose .*bone 1 mm/ }).press('Enter');
    expect(await rows.nth(1).getAttribute('aria-current')).toBe('true');
    await page.keyboard.type('bone'); // into the rule
    await page.keyboard.press('Enter');
    await expect.poll(() => page.locator('tr[data-order]', { hasText: '1.2.7.1' }).innerText()).toMatch(/waiting[^]*bone/);
    await page.close();
    expect(faults).toEqual([]);
  });

  it('stay up to date on older pages too', async () => {
    status = 503;
    const { id: older } = await order('1.2.3.6');
    await order('1.2.3.7');
    const { page, faults } = await openPage(at.browser, hospital.url);
    await page.route(/\/v1\/orders(\?|$)/, (route) => {
      const url = new URL(route.request().url());
      url.searchParams.set('limit', '1');
      return route.continue({ url: url.href });
    });
    await page.goto(`${hospital.url}/#/orders`);
    await expect.poll(() => page.locator('tr[data-order]').count()).toBe(1);
    await page.getByRole('button', { name: 'Older orders' }).click();
    const row = page.locator(`tr[data-order="${older}"]`);
    await expect.poll(() => row.locator('td').first().innerText()).toBe('waiting');
    await hospital.json(`/v1/orders/${older}`, { method: 'DELETE' });
    await expect.poll(() => row.locator('td').first().innerText()).toBe('cancelled');
    await page.close();
    expect(faults).toEqual([]);
  });

  it('are not spoken of where there is no hospital', async ({ page, daemon }) => {
    const missing: string[] = [];
    page.on('response', (response) => {
      if (response.status() >= 400) missing.push(response.url());
    });
    const asked = page.waitForResponse(`${daemon.url}/version`);
    await page.goto(daemon.url);
    await (await asked).finished();
    await page.getByRole('heading', { name: 'Recent surfaces' }).waitFor();
    await expect.poll(() => page.getByRole('link', { name: 'Orders', exact: true }).isVisible()).toBe(false);
    expect(missing).toEqual([]);
    await page.goto(`${daemon.url}/#/orders`);
    await expect.poll(() => page.locator('.refusal').innerText()).toMatch(/has no PACS/);
  });
});
