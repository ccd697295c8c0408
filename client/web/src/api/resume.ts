// Uploads that continue after their connection broke, by "Resumable Uploads for HTTP"
// (draft-ietf-httpbis-resumable-upload). docs/uploads.md says what the daemon supports.
import { isBusy, partingLimit } from './busy';
import type { Answer, Connection, Init } from './connection';
import { ApiError, errorOf, isPassing, isSuccess, notTheApi } from './problem';
import { sleep } from './sleep';

interface Options {
  signal?: AbortSignal;
  onProgress?: (sent: number, total: number) => void;
  onBusy?: (seconds: number) => void;
}

interface Reached {
  offset: number;
  isWhole: boolean;
}

const places = '/v1/uploads/';

// A part takes about a second, so that the progress is seen to move.
const leastPart = 1 << 20;
const mostPart = 32 << 20;
const shortTime = 500;
const longTime = 2000;

// The upload fails after this time without progress.
const longestCut = 60_000;
const firstPause = 100;
const longestPause = 3000;

// Throws an ApiError if the bytes cannot be read. The failure of a request tells this only in Node.
async function assertReadable(bytes: Blob): Promise<void> {
  try {
    await bytes.arrayBuffer();
  } catch (cause) {
    const error = new ApiError(-1, 'The file cannot be read', 'The file was changed or removed during the upload, or its disk failed. Open it again.');
    error.cause = cause;
    throw error;
  }
}

// Counts the time since the first failure after progress, and makes the pauses between retries longer. The time that a
// busy server asked for is no outage.
class Patience {
  private cut: number | null = null;
  private pause = firstPause;

  gotOn(): void {
    this.cut = null;
    this.pause = firstPause;
  }

  fail(): void {
    this.cut ??= Date.now();
  }

  excuse(seconds: number): void {
    if (this.cut !== null) this.cut += 1000 * seconds;
  }

  isOver(): boolean {
    return this.cut !== null && Date.now() - this.cut >= longestCut;
  }

  async wait(signal?: AbortSignal): Promise<void> {
    await sleep(this.pause, signal);
    this.pause = Math.min(2 * this.pause, longestPause);
  }
}

function isUnreachable(error: unknown): error is ApiError {
  return error instanceof ApiError && error.isUnreachable;
}

class Parts {
  private readonly patience = new Patience();
  private size = leastPart;
  private furthest = 0;
  private reached: Reached | null = { offset: 0, isWhole: false };

  constructor(
    private readonly connection: Connection,
    private readonly path: string,
    private readonly place: string,
    private readonly whole: Blob,
    private readonly options: Options,
  ) {}

  // Sends all parts. Returns the response to the last one, or the first error response that a retry cannot help.
  async answer(): Promise<Answer> {
    // A part that failed may have got on, so the upload is given up only after the daemon was asked.
    let giveUp: (() => Answer) | null = null;
    for (;;) {
      const { reached } = this;
      if (reached && giveUp && this.patience.isOver()) return giveUp();
      try {
        const answer = reached ? await this.send(reached) : await this.look();
        if (answer === null) continue;
        // With 409 the daemon still holds the broken connection; asked how far it is, it says so of cancelled uploads only.
        // If it is busy, the connection has waited for it already.
        const mayGoOn = (answer.status === 409 && reached !== null) || (isPassing(answer.status) && !isBusy(answer.status));
        if (!mayGoOn) return answer;
        giveUp = () => answer;
      } catch (error) {
        if (!isUnreachable(error)) throw error;
        if (reached) await assertReadable(this.part(reached.offset));
        giveUp = () => {
          throw error;
        };
      }
      this.patience.fail();
      if (!reached && this.patience.isOver()) return giveUp();
      this.reached = null;
      await this.patience.wait(this.options.signal);
    }
  }

  // Asks how much the daemon has. Returns null, or an error response.
  private async look(): Promise<Answer | null> {
    const answer = await this.ask(this.place, { method: 'HEAD' });
    // The reason of a conflict is in the body of a GET.
    if (answer.status === 409) return this.ask(this.place, {});
    if (!isSuccess(answer.status)) return answer;
    const text = answer.headers.get('Upload-Offset') ?? '';
    const offset = /^\d+$/.test(text) ? Number(text) : Infinity;
    // A proxy that asks for a login may respond.
    if (offset > this.whole.size) throw notTheApi();
    this.goTo({ offset, isWhole: answer.headers.get('Upload-Complete') === '?1' });
    return null;
  }

  // Sends one part. Returns null, the response to the last part, or an error response.
  private async send({ offset, isWhole }: Reached): Promise<Answer | null> {
    // All bytes are there, but the response was lost. This request repeats it.
    if (isWhole) {
      return this.ask(`${this.path}&upload=${this.place.split('/').at(-1)}`, { method: 'POST' });
    }
    const body = this.part(offset);
    const end = offset + body.size;
    const isLast = end === this.whole.size;
    const began = Date.now();
    const answer = await this.ask(this.place, {
      method: 'PATCH',
      body,
      headers: {
        'Content-Type': 'application/partial-upload',
        'Upload-Offset': String(offset),
        'Upload-Complete': isLast ? '?1' : '?0',
      },
    });
    if (isLast || !isSuccess(answer.status)) return answer;
    const took = Date.now() - began;
    if (took < shortTime) this.size = Math.min(2 * this.size, mostPart);
    if (took > longTime) this.size = Math.max(this.size / 2, leastPart);
    this.goTo({ offset: end, isWhole: false });
    return null;
  }

  private ask(path: string, init: Init): Promise<Answer> {
    const { signal } = this.options;
    const onBusy = (seconds: number): void => {
      this.patience.excuse(seconds);
      this.options.onBusy?.(seconds);
    };
    return this.connection.ask(path, { ...init, signal, onBusy });
  }

  private part(offset: number): Blob {
    return this.whole.slice(offset, offset + this.size);
  }

  private goTo(reached: Reached): void {
    this.reached = reached;
    if (reached.offset > this.furthest) this.patience.gotOn();
    this.furthest = Math.max(this.furthest, reached.offset);
    // The last part is reported by the caller: until its response, nobody knows that all of it was sent.
    this.options.onProgress?.(reached.offset, this.whole.size);
  }
}

// Returns the daemon's response to `POST path` with that body, also an error response.
export async function answerInParts(
  connection: Connection,
  path: string,
  headers: Record<string, string>,
  whole: Blob,
  options: Options,
): Promise<Answer> {
  const { signal, onBusy } = options;
  // An upload whose address is lost has no bytes, and expires.
  const begun = await connection.askAgain(path, {
    method: 'POST',
    signal,
    onBusy,
    headers: { ...headers, 'Upload-Complete': '?0', 'Upload-Length': String(whole.size) },
  });
  // A proxy may have made it absolute.
  const place = begun.headers.get('Location')?.replace(/^https?:\/\/[^/]*/, '') ?? '';
  if (!isSuccess(begun.status) || !place.startsWith(places)) throw errorOf(begun.status, begun.text, begun.headers);
  try {
    const answer = await new Parts(connection, path, place, whole, options).answer();
    if (answer.status !== 410) return answer;
    // The upload has expired, or another daemon has it.
    return await connection.ask(path, { method: 'POST', signal, onBusy, body: whole, headers });
  } catch (error) {
    // If this request fails, too, the daemon deletes the upload when it expires.
    if (!isUnreachable(error)) void connection.ask(place, { method: 'DELETE', retrySeconds: partingLimit }).catch(() => undefined);
    throw error;
  }
}
