// A person logs in at a real provider, and the page works with its token.
import { spawn, type ChildProcess } from 'node:child_process';
import { createInterface } from 'node:readline';
import { fileURLToPath } from 'node:url';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { Daemon, openPage, startBrowser, type OpenPage } from './support';

class LoginProvider {
  private constructor(
    private readonly process: ChildProcess,
    readonly issuer: string,
  ) {}

  static async start(): Promise<LoginProvider> {
    const program = fileURLToPath(new URL('login_provider.mjs', import.meta.url));
    const child = spawn(process.execPath, [program], { stdio: ['ignore', 'pipe', 'inherit'] });
    const issuer = await new Promise<string>((resolve, reject) => {
      createInterface({ input: child.stdout }).once('line', resolve);
      child.once('exit', (status) => reject(new Error(`the provider ended with ${status}`)));
    });
    return new LoginProvider(child, issuer);
  }

  async stop(): Promise<void> {
    const ended = new Promise((resolve) => this.process.once('exit', resolve));
    this.process.kill('SIGKILL');
    await ended;
  }
}

let browser: Browser;
let provider: LoginProvider;

beforeAll(async () => {
  [browser, provider] = await Promise.all([startBrowser(), LoginProvider.start()]);
});
afterAll(async () => {
  await browser?.close();
  await provider?.stop();
});

const byAccessToken = ['--oidc-audience', 'isomesh', '--oidc-client-id', 'isomesh-page', '--oidc-parameter', 'resource=https://isomesh.example/'];
const byIdToken = ['--oidc-audience', 'isomesh-page-by-id-token', '--oidc-client-id', 'isomesh-page-by-id-token', '--oidc-role', '*=user'];

// A daemon that takes the provider's tokens, and a page of it.
async function withLogin(options: string[], run: (daemon: Daemon, opened: OpenPage) => Promise<void>): Promise<void> {
  const daemon = await Daemon.start(undefined, '127.0.0.1:0', ['--oidc-issuer', provider.issuer, ...options]);
  try {
    const context = await browser.newContext();
    // The provider's page wants a font.
    await context.route('https://**', (route) => route.abort());
    const opened = await openPage(context, daemon.url);
    await run(daemon, opened);
    await context.close();
    const others = opened.faults.filter((fault) => !fault.startsWith(`asked for ${provider.issuer}/`) && !fault.startsWith('asked for https://fonts.'));
    expect(others).toEqual([]);
  } finally {
    await daemon.remove();
  }
}

async function logIn(page: Page, name: string): Promise<void> {
  await page.getByRole('button', { name: 'Log in' }).click();
  await page.getByPlaceholder('Enter any login').fill(name);
  await page.getByPlaceholder('and password').fill('secret');
  await page.getByRole('button', { name: 'Sign-in' }).click();
  await page.getByRole('button', { name: 'Continue' }).click();
}

function keptToken(page: Page): Promise<string> {
  return page.evaluate(() => sessionStorage.getItem('isomesh.token') ?? '');
}

function claimsOf(token: string): Record<string, unknown> {
  return JSON.parse(Buffer.from(token.split('.')[1] ?? '', 'base64url').toString()) as Record<string, unknown>;
}

describe('a login', () => {
  test('leads back to the view, and works with the access token', async () => {
    await withLogin(byAccessToken, async (daemon, { page }) => {
      await page.goto(`${daemon.url}/#/jobs`);
      await page.getByRole('heading', { name: 'This server requires a login' }).waitFor();
      // Without --tokens there are none to enter.
      expect(await page.getByLabel('Token', { exact: true }).count()).toBe(0);
      await logIn(page, 'ann');
      await page.getByRole('heading', { name: 'Jobs', exact: true }).waitFor();
      expect(page.url()).toBe(`${daemon.url}/#/jobs`);
      const token = await keptToken(page);
      expect(claimsOf(token)).toMatchObject({ sub: 'ann', aud: 'isomesh', iss: provider.issuer });
      expect(await page.evaluate(() => sessionStorage.getItem('isomesh.login'))).toBeNull();
      // Clients send the same token.
      const headers = { Authorization: `Bearer ${token}` };
      expect((await fetch(`${daemon.url}/v1/jobs`, { headers })).status).toBe(200);
      expect((await fetch(`${daemon.url}/metrics`, { headers })).status).toBe(403);
    });
  });

  test('works with the ID token of a provider without audiences', async () => {
    await withLogin(byIdToken, async (daemon, { page }) => {
      await page.goto(daemon.url);
      await logIn(page, 'bob');
      await expect.poll(() => keptToken(page)).not.toBe('');
      expect(claimsOf(await keptToken(page))).toMatchObject({ sub: 'bob', aud: 'isomesh-page-by-id-token' });
      await page.getByRole('heading', { name: 'Volumes', exact: true }).waitFor();
    });
  });

  test('of a person without a role says so', async () => {
    await withLogin(byAccessToken, async (daemon, { page }) => {
      await page.goto(daemon.url);
      await logIn(page, 'visitor');
      await page.getByText('gives you no role in this service').first().waitFor();
    });
  });

  test('that this tab has not begun is rejected', async () => {
    await withLogin(byAccessToken, async (daemon, { page }) => {
      await page.goto(`${daemon.url}/?code=stolen&state=guessed#/jobs`);
      await page.getByText('This tab has not begun this login').waitFor();
      expect(page.url()).toBe(`${daemon.url}/`);
      expect(await keptToken(page)).toBe('');
    });
  });
});
