// Fetches what the daemon sends as a preview, and reads it in a worker.
import { client } from '../client';
import type { LabelMap } from './label_map';
import type { Preview } from './preview';
import type { PreviewAnswer, PreviewRequest } from './preview.worker';
import type { Window } from './slices';

// The most samples along an axis that the daemon sends.
export const largestPreview = 256;

export async function fetchPreview(volume: string, size: number, window: Window, signal: AbortSignal): Promise<Preview> {
  const file = await client.previewFile(volume, size, window, signal);
  return readPreview({ file, window }, [file], signal);
}

// Of a volume whose samples all come: a mean of labels is none of them.
export async function fetchLabelPreview(volume: string, { windows, labels }: LabelMap, signal: AbortSignal): Promise<Preview> {
  const files = await Promise.all(windows.map((window) => client.previewFile(volume, largestPreview, [...window], signal)));
  return readPreview({ files, labels }, files, signal);
}

// The buffers are the worker's from then on.
function readPreview(request: PreviewRequest, buffers: ArrayBuffer[], signal: AbortSignal): Promise<Preview> {
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
