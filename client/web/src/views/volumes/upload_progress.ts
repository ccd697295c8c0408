// How far an upload is.
import { h } from '../../ui/dom';
import { formatBytes } from '../../ui/format';

// Sooner a pause is none.
const stillAfter = 3000;

export class UploadProgress {
  readonly bar: HTMLProgressElement;
  readonly text = h('p.upload-status', { role: 'status' });
  private readonly began = performance.now();
  private still = 0;

  // Without bytes: the server has them already.
  constructor(private readonly total: number) {
    this.bar = h('progress', { max: Math.max(1, total), value: 0, 'aria-label': 'Upload' });
    if (total > 0) return;
    this.bar.removeAttribute('value');
    this.text.textContent = 'The server is reading the files that it already has';
  }

  show(sent: number): void {
    if (this.total === 0) return;
    clearTimeout(this.still);
    this.bar.value = sent;
    if (sent >= this.total) {
      this.bar.removeAttribute('value');
      this.text.textContent = `${formatBytes(this.total)} sent; the server is reading the volume`;
      return;
    }
    const rate = sent / Math.max(0.001, (performance.now() - this.began) / 1000);
    const text = `${formatBytes(sent)} of ${formatBytes(this.total)}`;
    this.text.textContent = `${text}, ${formatBytes(rate)}/s`;
    this.still = window.setTimeout(() => (this.text.textContent = `${text}. Waiting for the server`), stillAfter);
  }

  // The request was refused for the moment, and is sent again.
  showBusy(): void {
    clearTimeout(this.still);
    this.bar.removeAttribute('value');
    this.text.textContent = 'The server is busy. The upload is tried again automatically';
  }

  // The upload is over: nothing is waited for any more.
  end(): void {
    clearTimeout(this.still);
  }
}
