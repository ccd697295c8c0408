// Reads previews beside the page.
import { previewOf, type Preview } from './preview';
import type { Window } from './slices';

export interface PreviewRequest {
  file: ArrayBuffer;
  window: Window;
}

export interface PreviewAnswer {
  preview: Preview | null;
  error: string;
}

interface WorkerScope {
  onmessage: ((event: MessageEvent<PreviewRequest>) => void) | null;
  postMessage(message: PreviewAnswer, transfer: Transferable[]): void;
}
const scope = self as unknown as WorkerScope;

scope.onmessage = ({ data: { file, window } }) => {
  try {
    const preview = previewOf(file, window);
    scope.postMessage({ preview, error: '' }, [preview.samples.buffer, preview.blocks.buffer]);
  } catch (error) {
    scope.postMessage({ preview: null, error: String(error) }, []);
  }
};
