// Has coarse copies made, beside the page, of a surface that comes block by block; once they are wanted.
import type { Coarse } from '../mesh/coarse';
import type { CoarseAnswer, CoarseRequest } from '../mesh/coarse.worker';
import { buffersIn } from '../mesh/transfer';

// While blocks come, copies are made anew when there are so many times as many triangles as in the last ones.
const growth = 1.5;

export class CoarseMaker {
  private worker: Worker | null = null;
  private waiting: CoarseRequest['parts'] = [];
  private come = 0;
  private made = 0;
  private isWanted = false;
  private isMaking = false;
  private isWhole = false;

  // `most` are the most triangles of each level.
  constructor(
    private readonly most: readonly number[],
    private readonly onMade: (levels: CoarseAnswer) => void,
  ) {}

  // Takes the arrays over.
  add(surface: number, coarse: Coarse): void {
    this.waiting.push({ surface, coarse });
    this.come += coarse.index.length;
    this.make();
  }

  want(): void {
    this.isWanted = true;
    this.make();
  }

  // All blocks have come.
  finish(): void {
    this.isWhole = true;
    this.make();
  }

  dispose(): void {
    this.worker?.terminate();
    this.worker = null;
    this.isWanted = false;
  }

  private make(): void {
    const isTime = this.isWhole || this.come >= growth * this.made;
    if (!this.isWanted || this.isMaking || this.waiting.length === 0 || !isTime) return;
    this.isMaking = true;
    this.made = this.come;
    const parts = this.waiting.splice(0);
    this.worker ??= this.start();
    this.worker.postMessage({ parts, most: this.most } satisfies CoarseRequest, buffersIn(parts));
  }

  private start(): Worker {
    const worker = new Worker(new URL('../mesh/coarse.worker.ts', import.meta.url), { type: 'module' });
    worker.onmessage = ({ data }: MessageEvent<CoarseAnswer>) => {
      this.isMaking = false;
      this.onMade(data);
      this.make();
      if (this.isWhole && !this.isMaking) this.dispose();
    };
    // Without copies the surface is turned whole.
    worker.onerror = () => this.dispose();
    return worker;
  }
}
