// Reads what the daemon sends as a preview, in a worker.
import type { Preview } from './preview';
import type { PreviewAnswer, PreviewRequest } from './preview.worker';

// The buffers are the worker's from then on.
export function readPreview(request: PreviewRequest, buffers: ArrayBuffer[], signal: AbortSignal): Promise<Preview> {
  return new Promise((resolve, reject) => {
    const worker = new Worker(new URL('./preview.worker.ts', import.meta.url), { type: 'module' });
    const end = (): void => {
      worker.terminate();
      reject(new DOMException('Not wanted any more', 'AbortError'));
    };
    signal.addEventListener('abort', end, { once: true });
    worker.onmessage = ({ data: { preview, error } }: MessageEvent<PreviewAnswer>) => {
      worker.terminate();
      signal.removeEventListener('abort', end);
      if (preview) resolve(preview);
      else reject(new Error(error));
    };
    worker.onerror = (event) => reject(new Error(event.message));
    worker.postMessage(request, buffers);
  });
}
