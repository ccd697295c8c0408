// Uploads that go on where their connection broke: "Resumable Uploads for HTTP"
// (draft-ietf-httpbis-resumable-upload), of which docs/uploads.md tells what the daemon knows.
import { ask } from './client';
import { sleep } from './job_events';
import { errorOf } from './problem';

interface Options {
  signal?: AbortSignal;
  onProgress?: (sent: number, total: number) => void;
}

interface Reached {
  offset: number;
  isWhole: boolean;
}

// Parts are as large as a connection takes in about a second, so that their progress is seen.
const leastPart = 1 << 20;
const mostPart = 32 << 20;
const shortTime = 500;
const longTime = 2000;

// How long no byte gets through before an upload is given up.
const longestCut = 60_000;
const firstPause = 100;
const longestPause = 3000;
// The daemon is busy, or ends, or still has the connection that broke.
const passing = [408, 409, 429, 502, 503, 504];

// Whether there is still patience, and the pause before the next try.
class Patience {
  private cut: number | null = null;
  private pause = firstPause;

  gotOn(): void {
    this.cut = null;
    this.pause = firstPause;
  }

  isOver(): boolean {
    this.cut ??= Date.now();
    return Date.now() - this.cut >= longestCut;
  }

  async wait(signal?: AbortSignal): Promise<void> {
    await sleep(this.pause, signal);
    this.pause = Math.min(2 * this.pause, longestPause);
  }
}

class Parts {
  private readonly patience = new Patience();
  private size = leastPart;
  private furthest = 0;
  private reached: Reached | null = { offset: 0, isWhole: false };

  constructor(
    private readonly path: string,
    private readonly place: string,
    private readonly whole: Blob,
    private readonly options: Options,
  ) {}

  // The answer to the last part, or a refusal.
  async answer(): Promise<Response> {
    const { signal } = this.options;
    for (;;) {
      try {
        const answer = this.reached === null ? await this.look() : await this.send(this.reached);
        if (answer && (!passing.includes(answer.status) || this.patience.isOver())) return answer;
        if (answer === null) continue;
      } catch (error) {
        if (signal?.aborted || this.patience.isOver()) throw error;
      }
      this.reached = null;
      await this.patience.wait(signal);
    }
  }

  // Finds out how much the daemon has; its answer where that is a refusal.
  private async look(): Promise<Response | null> {
    const answer = await ask(this.place, { method: 'HEAD', signal: this.options.signal });
    if (!answer.ok) return answer;
    const offset = Number(answer.headers.get('Upload-Offset'));
    this.goTo({ offset, isWhole: answer.headers.get('Upload-Complete') === '?1' });
    return null;
  }

  // Sends one part; the answer where it was the last one or is refused.
  private async send({ offset, isWhole }: Reached): Promise<Response | null> {
    const { signal } = this.options;
    // Who asks like this hears what has become of it.
    if (isWhole) return ask(`${this.path}&upload=${this.place.split('/').at(-1)}`, { method: 'POST', signal });
    const end = Math.min(this.whole.size, offset + this.size);
    const isLast = end === this.whole.size;
    const began = Date.now();
    const answer = await ask(this.place, {
      method: 'PATCH',
      signal,
      body: this.whole.slice(offset, end),
      headers: {
        'Content-Type': 'application/partial-upload',
        'Upload-Offset': String(offset),
        'Upload-Complete': isLast ? '?1' : '?0',
      },
    });
    if (isLast || !answer.ok) return answer;
    const took = Date.now() - began;
    if (took < shortTime) this.size = Math.min(2 * this.size, mostPart);
    if (took > longTime) this.size = Math.max(this.size / 2, leastPart);
    this.goTo({ offset: end, isWhole: false });
    return null;
  }

  private goTo(reached: Reached): void {
    this.reached = reached;
    if (reached.offset > this.furthest) this.patience.gotOn();
    this.furthest = Math.max(this.furthest, reached.offset);
    // While the last part is on its way the daemon is not reading the volume yet.
    this.options.onProgress?.(reached.offset, this.whole.size);
  }
}

// The daemon's answer to `POST path` with that body, whatever it says.
export async function answerInParts(
  path: string,
  headers: Record<string, string>,
  whole: Blob,
  options: Options,
): Promise<Response> {
  const begun = await ask(path, {
    method: 'POST',
    signal: options.signal,
    headers: { ...headers, 'Upload-Complete': '?0', 'Upload-Length': String(whole.size) },
  });
  const place = begun.headers.get('Location');
  if (!begun.ok || place === null) throw errorOf(begun.status, await begun.text());
  try {
    const answer = await new Parts(path, place, whole, options).answer();
    if (answer.status !== 410) return answer;
    // It has expired, or another daemon answers than the one that has it.
    return await ask(path, { method: 'POST', signal: options.signal, body: whole, headers });
  } catch (error) {
    // What is left there expires, where nobody can be told.
    if (options.signal?.aborted) void ask(place, { method: 'DELETE' }).catch(() => undefined);
    throw error;
  }
}
