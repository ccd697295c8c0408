// Brings the preview over the window that is wanted: one request at a time, of which the next is for what is wanted last.
import type { Preview } from './preview';
import type { Window } from './slices';

export interface PreviewLoaderHost {
  fetch: (window: Window) => Promise<Preview>;
  // Another preview is there.
  onChange: () => void;
  onError: (error: unknown) => void;
}

export class PreviewLoader {
  // Over the window that is wanted, or the last one that was there.
  preview: Preview | null = null;
  private wanted: Window | null = null;
  private isBusy = false;
  private hasFailed = false;

  constructor(private readonly host: PreviewLoaderHost) {}

  // A window whose preview failed is not asked for again, except by `retry`: the page wants it at every step of a slice.
  want(window: Window): void {
    if (window.join() === this.wanted?.join()) return;
    this.wanted = window;
    void this.load();
  }

  retry(): void {
    if (this.hasFailed) void this.load();
  }

  private async load(): Promise<void> {
    const { wanted } = this;
    if (!wanted || this.isBusy) return;
    this.isBusy = true;
    this.hasFailed = false;
    try {
      this.preview = await this.host.fetch(wanted);
      this.host.onChange();
    } catch (error) {
      this.hasFailed = wanted === this.wanted;
      if (this.hasFailed) this.host.onError(error);
    } finally {
      this.isBusy = false;
    }
    if (wanted !== this.wanted) void this.load();
  }
}
