// Logs a person in at the server's login provider: OpenID Connect, authorization code with PKCE (RFC 7636). The page goes
// to the provider and comes back with a code, which it exchanges for a token.
import { ApiError, jsonOf } from '../api/problem';
import type { Login, LoginProvider } from '../api/types';
import { client, token } from '../client';

const key = 'isomesh.login';
const failed = 'The login failed';

// The page remembers this while the person is at the provider.
interface Begun {
  provider: LoginProvider;
  state: string;
  nonce: string;
  verifier: string;
  hash: string;
}

export async function findLogin(): Promise<Login> {
  const { status, text, headers } = await client.connection.ask('/login', { retrySeconds: 0 });
  return jsonOf(status, text, headers) as Login;
}

function base64url(bytes: Uint8Array): string {
  return btoa(String.fromCharCode(...bytes)).replace(/\+/g, '-').replace(/\//g, '_').replace(/=+$/, '');
}

function randomText(): string {
  return base64url(crypto.getRandomValues(new Uint8Array(32)));
}

function ownAddress(): string {
  return window.location.origin + window.location.pathname;
}

// Leaves the page.
export async function beginLogin(provider: LoginProvider): Promise<void> {
  if (!window.isSecureContext) throw new ApiError(-1, failed, 'Browsers allow a login only if the page was loaded with https.');
  const begun: Begun = { provider, state: randomText(), nonce: randomText(), verifier: randomText(), hash: window.location.hash };
  const digest = await crypto.subtle.digest('SHA-256', new TextEncoder().encode(begun.verifier));
  sessionStorage.setItem(key, JSON.stringify(begun));
  const address = new URL(provider.authorization_endpoint);
  const parameters = {
    scope: 'openid',
    ...provider.parameters,
    response_type: 'code',
    client_id: provider.client_id,
    redirect_uri: ownAddress(),
    state: begun.state,
    nonce: begun.nonce,
    code_challenge: base64url(new Uint8Array(digest)),
    code_challenge_method: 'S256',
  };
  for (const [name, value] of Object.entries(parameters)) address.searchParams.set(name, value);
  window.location.assign(address.href);
}

// Takes what the page remembered, so that no answer is used twice.
function takeBegun(): Begun | null {
  const text = sessionStorage.getItem(key);
  sessionStorage.removeItem(key);
  return text === null ? null : (JSON.parse(text) as Begun);
}

// Call when the page starts. Does nothing unless the address has the answer of a provider. Throws an ApiError if the login
// fails.
export async function finishLogin(): Promise<void> {
  const answer = new URLSearchParams(window.location.search);
  if (!answer.has('state') || !(answer.has('code') || answer.has('error'))) return;
  const begun = takeBegun();
  // The code must stay neither in the address nor in the history.
  history.replaceState(null, '', ownAddress() + (begun?.hash ?? ''));
  if (begun === null || answer.get('state') !== begun.state) {
    throw new ApiError(-1, failed, 'This tab has not begun this login. Log in again.');
  }
  // A provider may say who it is (RFC 9207).
  if (answer.has('iss') && answer.get('iss') !== begun.provider.issuer) {
    throw new ApiError(-1, failed, 'Another provider has answered. Log in again.');
  }
  const code = answer.get('code');
  if (code === null) throw new ApiError(-1, failed, `The login provider says: ${answer.get('error_description') ?? answer.get('error') ?? ''}`);
  token.value = tokenIn(await exchanged(code, begun), begun);
}

// The provider's tokens for the code.
async function exchanged(code: string, { provider, verifier }: Begun): Promise<Record<string, unknown>> {
  const body = new URLSearchParams({
    ...provider.parameters,
    grant_type: 'authorization_code',
    code,
    redirect_uri: ownAddress(),
    client_id: provider.client_id,
    code_verifier: verifier,
  });
  let response: Response;
  try {
    response = await fetch(provider.token_endpoint, { method: 'POST', body, credentials: 'omit', redirect: 'error' });
  } catch {
    throw new ApiError(-1, failed, `The login provider at ${new URL(provider.token_endpoint).origin} did not respond, or does not allow requests of this page (CORS).`);
  }
  const tokens: unknown = await response.json().catch(() => null);
  if (!response.ok || typeof tokens !== 'object' || tokens === null) {
    throw new ApiError(-1, failed, `The login provider gave no token. It answered with status ${response.status}.`);
  }
  return tokens as Record<string, unknown>;
}

// The claims of a token. The page reads them only from a token that came from the provider itself.
function claimsOf(text: unknown): Record<string, unknown> {
  try {
    const payload = String(text).split('.')[1] ?? '';
    const bytes = Uint8Array.from(atob(payload.replace(/-/g, '+').replace(/_/g, '/')), (c) => c.charCodeAt(0));
    return JSON.parse(new TextDecoder().decode(bytes)) as Record<string, unknown>;
  } catch {
    return {};
  }
}

// The token to send, if the login is the one that this page began.
function tokenIn(tokens: Record<string, unknown>, { provider, nonce }: Begun): string {
  const { nonce: told, iss, aud } = claimsOf(tokens.id_token);
  if (told !== nonce || iss !== provider.issuer || ![aud].flat().includes(provider.client_id)) {
    throw new ApiError(-1, failed, 'The answer of the login provider is for another login. Log in again.');
  }
  const value = tokens[provider.token];
  if (typeof value !== 'string' || value === '') throw new ApiError(-1, failed, 'The login provider gave no token for this server.');
  return value;
}
