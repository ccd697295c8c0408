// Requests to one server, on a page and in Node. A failure is thrown as an ApiError.
import { Signal } from '../ui/signal';
import { BusyPauses, checkedLimit, isBusy, usualLimit, type HeaderValues } from './busy';
import { ApiError, asApiError, errorOf, jsonOf } from './problem';
import { sleep } from './sleep';

const retries = 3;

// The address without the slash at its end.
function baseOf(server: string | undefined): string {
  const example = "new Client({ server: 'http://127.0.0.1:8080' })";
  if (server === undefined && typeof location === 'undefined') {
    throw new TypeError(`The client needs the server's address, such as ${example}.`);
  }
  if (server && !/^https?:\/\/[^/]/.test(server)) {
    throw new TypeError(`The server's address must begin with http:// or https://, such as ${example}. It is "${server}".`);
  }
  return (server ?? '').replace(/\/+$/, '');
}

// A page is told no status of a redirect.
function isRedirect({ status, type }: Response): boolean {
  return type === 'opaqueredirect' || (status >= 300 && status < 400 && status !== 304);
}

function redirected(): ApiError {
  return new ApiError(
    -1,
    'The server redirects to another address',
    'Requests go to the named server only. Give the address that it redirects to. A proxy before it may ask for a login.',
  );
}

// A response with its whole body.
export interface Answer {
  status: number;
  headers: HeaderValues;
  text: string;
}

export type Init = RequestInit & {
  // How long the server may be busy, if that differs from the connection's own limit.
  retrySeconds?: number;
  // Called before each pause, with its seconds.
  onBusy?: (seconds: number) => void;
};

export class Connection {
  // False after a request that got no whole response.
  readonly connected = new Signal<boolean>(true);
  // True after the server has rejected the token, or asked for one.
  readonly unauthorized = new Signal<boolean>(false);
  // Requests carry this token. An empty one is not sent.
  readonly token: Signal<string>;
  // True while requests wait because the server is busy.
  readonly busy = new Signal<boolean>(false);
  private waiting = 0;
  // The address without a slash at its end, or empty for the server that the page comes from.
  readonly base: string;
  private readonly retrySeconds: number;

  // An empty address stands for the server that the page comes from.
  constructor(server: string | undefined, token: string, retrySeconds = usualLimit) {
    this.base = baseOf(server);
    this.retrySeconds = checkedLimit(retrySeconds);
    this.token = new Signal(token);
  }

  // Throws an ApiError if the path, which may come from a response, would lead to another server.
  addressOf(path: string): string {
    // Browsers leave out tabs and line breaks: two slashes around one would be followed by a host.
    if (!/^\/(?![/\\])[^\t\r\n]*$/.test(path)) throw new ApiError(-1, 'The response is not one of isomeshd', `It names the address ${JSON.stringify(path)}.`);
    return this.base + path;
  }

  // Throws an ApiError if the token cannot be part of a header.
  headers(more: Record<string, string> = {}): Record<string, string> {
    if (this.token.value === '') return more;
    const headers = { ...more, Authorization: `Bearer ${this.token.value}` };
    try {
      new Headers(headers);
    } catch {
      // The cause is left out because it may contain the token.
      this.unauthorized.value = true;
      throw new ApiError(-1, 'The token cannot be sent', 'The token has a line break or a character that HTTP headers cannot carry.');
    }
    return headers;
  }

  // Returns every response, also one with an error status.
  async ask(path: string, init: Init = {}): Promise<Answer> {
    const response = await this.begin(path, init);
    const text = await this.received(response.text(), init);
    return { status: response.status, headers: response.headers, text };
  }

  // The same for a request that may be sent twice. It is sent again if the server cannot be reached or its response is lost.
  async askAgain(path: string, init: Init): Promise<Answer> {
    for (let attempt = 1; ; attempt += 1) {
      try {
        return await this.ask(path, init);
      } catch (error) {
        if (attempt > retries || !(error instanceof ApiError && error.isUnreachable)) throw error;
      }
      await sleep(500 * attempt, init.signal);
      init.signal?.throwIfAborted();
    }
  }

  // Returns the response before its body has come. Throws an ApiError for one with an error status.
  async send(path: string, init: Init = {}): Promise<Response> {
    const response = await this.begin(path, init);
    if (!response.ok) throw errorOf(response.status, await this.received(response.text(), init), response.headers);
    return response;
  }

  async json<T>(path: string, init?: RequestInit): Promise<T> {
    const { status, text, headers } = await this.ask(path, init);
    return jsonOf(status, text, headers) as T;
  }

  async blob(path: string, init: RequestInit = {}): Promise<Blob> {
    return this.received((await this.send(path, init)).blob(), init);
  }

  async bytes(path: string, init: RequestInit = {}): Promise<ArrayBuffer> {
    return this.received((await this.send(path, init)).arrayBuffer(), init);
  }

  private async wait(milliseconds: number, signal: AbortSignal | null | undefined): Promise<void> {
    this.waiting += 1;
    this.busy.value = true;
    await sleep(milliseconds, signal);
    this.waiting -= 1;
    this.busy.value = this.waiting > 0;
    signal?.throwIfAborted();
  }

  // All requests go through this. It waits until the server is no longer busy, or the time is over: every request of the
  // API can be repeated, and so can its body.
  private async begin(path: string, { retrySeconds = this.retrySeconds, onBusy, ...init }: Init): Promise<Response> {
    const pauses = new BusyPauses(retrySeconds);
    for (;;) {
      const headers = this.headers(init.headers as Record<string, string>);
      // Volumes and tokens are for the named server only.
      const response = await this.received(fetch(this.addressOf(path), { ...init, headers, redirect: 'manual' }), init);
      this.connected.value = true;
      if (isRedirect(response)) throw redirected();
      if (response.status === 401) this.unauthorized.value = true;
      const seconds = isBusy(response.status) ? pauses.next(response.headers) : null;
      if (seconds === null) return response;
      // Or Node keeps the connection for a body that nobody reads.
      void response.body?.cancel().catch(() => undefined);
      onBusy?.(seconds);
      await this.wait(1000 * seconds, init.signal);
    }
  }

  // A connection may break before a response and in its body.
  private async received<T>(coming: Promise<T>, { signal }: RequestInit): Promise<T> {
    try {
      return await coming;
    } catch (error) {
      // The caller ended the request. This says nothing about the server.
      if (signal?.aborted) throw signal.reason;
      const failure = asApiError(error, this.base);
      if (failure.isUnreachable) this.connected.value = false;
      throw failure;
    }
  }

  async isAlive(): Promise<boolean> {
    try {
      return (await fetch(this.addressOf('/livez'), { cache: 'no-store' })).ok;
    } catch {
      return false;
    }
  }
}
