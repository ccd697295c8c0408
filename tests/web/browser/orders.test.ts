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

beforeAll(async () => {
  pacs = createServer((_, answer) => answer.writeHead(status, { 'Content-Type': 'application/json' }).end('[]'));
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
