// Reads previews beside the page.
import type { WorkerScope } from '../mesh/transfer';
import { labelPreviewOf, previewOf, type Preview } from './preview';
import type { MappedLabel } from './label_map';
import type { Window } from './slices';

// Of values over a window, or of labels.
export type PreviewRequest = { file: ArrayBuffer; window: Window } | { files: ArrayBuffer[]; labels: readonly MappedLabel[] };

export interface PreviewAnswer {
  preview: Preview | null;
  error: string;
}

const scope = self as unknown as WorkerScope<PreviewRequest, PreviewAnswer>;

scope.onmessage = ({ data }) => {
  try {
    const preview = 'labels' in data ? labelPreviewOf(data.files, data.labels) : previewOf(data.file, data.window);
    scope.postMessage({ preview, error: '' }, [preview.samples.buffer, preview.blocks.buffer]);
  } catch (error) {
    scope.postMessage({ preview: null, error: String(error) }, []);
  }
};
