// Workers that decode, so that the page never waits for them.
import type { Block } from './blocks';
import type { DecodeAnswer, DecodeRequest } from './decode.worker';

interface Task {
  request: DecodeRequest;
  resolve: (blocks: Block[]) => void;
  reject: (error: Error) => void;
}

const mostWorkers = 4;

class DecodePool {
  private readonly idle: Worker[] = [];
  private readonly waiting: Task[] = [];
  private started = 0;
  private nextId = 0;

  decode(
    bytes: Uint8Array<ArrayBuffer>,
    options: Omit<DecodeRequest, 'id' | 'bytes'>,
    signal: AbortSignal,
  ): Promise<Block[]> {
    return new Promise((resolve, reject) => {
      const task: Task = { request: { id: this.nextId++, bytes, ...options }, resolve, reject };
      signal.addEventListener('abort', () => {
        const place = this.waiting.indexOf(task);
        if (place >= 0) this.waiting.splice(place, 1);
        reject(new DOMException('No longer wanted', 'AbortError'));
      });
      this.waiting.push(task);
      this.pump();
    });
  }

  private pump(): void {
    const most = Math.max(1, Math.min(mostWorkers, (navigator.hardwareConcurrency || 2) - 1));
    while (this.waiting.length > 0) {
      let worker = this.idle.pop();
      if (!worker) {
        if (this.started >= most) return;
        worker = new Worker(new URL('./decode.worker.ts', import.meta.url), { type: 'module' });
        this.started += 1;
      }
      this.run(worker, this.waiting.shift() as Task);
    }
  }

  private run(worker: Worker, task: Task): void {
    worker.onmessage = (event: MessageEvent<DecodeAnswer>) => {
      this.idle.push(worker);
      if (event.data.error === '') task.resolve(event.data.blocks);
      else task.reject(new Error(event.data.error));
      this.pump();
    };
    worker.onerror = (event) => {
      worker.terminate();
      this.started -= 1;
      task.reject(new Error(event.message || 'The decoder could not be started.'));
      this.pump();
    };
    worker.postMessage(task.request, [task.request.bytes.buffer]);
  }
}

export const decoders = new DecodePool();
