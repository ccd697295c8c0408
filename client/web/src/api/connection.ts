// Requests to one server, on a page and in Node. A failure is thrown as an ApiError.
import { Signal } from '../ui/signal';
import { asApiError, errorOf } from './problem';

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

export class Connection {
  // False after a request that got no response.
  readonly connected = new Signal<boolean>(true);
  // True after the server has rejected the token, or asked for one.
  readonly unauthorized = new Signal<boolean>(false);
  // Requests carry this token. An empty one is not sent.
  readonly token: Signal<string>;
  private readonly base: string;

  // An empty address stands for the server that the page comes from.
  constructor(server: string | undefined, token: string) {
    this.base = baseOf(server);
    this.token = new Signal(token);
  }

  addressOf(path: string): string {
    return this.base + path;
  }

  headers(more: Record<string, string> = {}): Record<string, string> {
    return this.token.value === '' ? more : { ...more, Authorization: `Bearer ${this.token.value}` };
  }

  // Returns every response, also one with an error status.
  async ask(path: string, init: RequestInit = {}): Promise<Response> {
    let response: Response;
    try {
      response = await fetch(this.addressOf(path), { ...init, headers: this.headers(init.headers as Record<string, string>) });
    } catch (error) {
      // The caller ended the request. This says nothing about the server.
      if (init.signal?.aborted) throw init.signal.reason;
      this.connected.value = false;
      throw asApiError(error);
    }
    this.connected.value = true;
    if (response.status === 401) this.unauthorized.value = true;
    return response;
  }

  // Throws an ApiError for a response with an error status.
  async send(path: string, init: RequestInit = {}): Promise<Response> {
    const response = await this.ask(path, init);
    if (!response.ok) throw errorOf(response.status, await response.text());
    return response;
  }

  async json<T>(path: string, init?: RequestInit): Promise<T> {
    return (await (await this.send(path, init)).json()) as T;
  }

  async isAlive(): Promise<boolean> {
    try {
      return (await fetch(this.addressOf('/livez'), { cache: 'no-store' })).ok;
    } catch {
      return false;
    }
  }
}
