// Has coarse copies made, beside the page, of a surface that comes block by block; once they are wanted.
import type { Block } from '../mesh/blocks';
import type { Coarse } from '../mesh/coarse';
import type { CoarseAnswer, CoarseRequest } from '../mesh/coarse.worker';

// While blocks come, copies are made anew when there are so many times as many triangles as in the last ones.
const growth = 1.5;

export class CoarseMaker {
  private worker: Worker | null = null;
  private waiting: { surface: number; block: Block }[] = [];
  private taken = 0;
  private made = 0;
  private isWanted = false;
  private isWhole = false;
  // The worker has something to do.
  private isBusy = false;

  // `most` are the most triangles of each level.
  constructor(
    private readonly most: readonly number[],
    private readonly onMade: (levels: readonly (readonly Coarse[])[]) => void,
  ) {}

  add(surface: number, block: Block): void {
    this.waiting.push({ surface, block });
    this.start();
  }

  // These blocks are all there are now.
  restart(blocks: { surface: number; block: Block }[]): void {
    const isWanted = this.isWanted;
    this.dispose();
    Object.assign(this, { waiting: blocks, taken: 0, made: 0, isBusy: false, isWanted });
    this.start();
  }

  want(): void {
    this.isWanted = true;
    this.start();
  }

  // All blocks have come.
  finish(): void {
    this.isWhole = true;
    this.start();
  }

  dispose(): void {
    this.worker?.terminate();
    this.worker = null;
    this.isWanted = false;
  }

  private start(): void {
    if (!this.isWanted || this.isBusy) return;
    this.worker ??= this.startWorker();
    this.next();
  }

  private startWorker(): Worker {
    const worker = new Worker(new URL('../mesh/coarse.worker.ts', import.meta.url), { type: 'module' });
    worker.onmessage = ({ data }: MessageEvent<CoarseAnswer>) => {
      if (worker !== this.worker) return;
      this.isBusy = false;
      if (data) this.onMade(data);
      this.next();
    };
    // Without copies the surface is turned whole.
    worker.onerror = () => this.dispose();
    return worker;
  }

  // A block is copied when the one before is done, so that the page never copies all of them at once.
  private next(): void {
    const next = this.waiting.shift();
    if (next) {
      const { surface, block: { positions, normals, index, distances } } = next;
      this.taken += index.length;
      this.ask({ surface, block: { positions, normals, index, ...(distances && { distances }) } });
    } else if (this.taken > this.made && (this.isWhole || this.taken >= growth * this.made)) {
      this.made = this.taken;
      this.ask({ most: this.most });
    } else if (this.isWhole && this.taken > 0) {
      this.worker?.terminate();
      this.worker = null;
    }
  }

  private ask(request: CoarseRequest): void {
    this.isBusy = true;
    this.worker?.postMessage(request);
  }
}
