// How far an upload is.
import { h } from '../ui/dom';
import { formatBytes } from '../ui/format';

export class UploadProgress {
  readonly bar: HTMLProgressElement;
  readonly text = h('p', { class: 'upload-status', role: 'status' });
  private readonly began = performance.now();

  constructor(private readonly total: number) {
    this.bar = h('progress', { max: total, value: 0, 'aria-label': 'Upload' });
  }

  show(sent: number): void {
    this.bar.value = sent;
    if (sent >= this.total) {
      this.bar.removeAttribute('value');
      this.text.textContent = `${formatBytes(this.total)} sent; the server reads the volume`;
      return;
    }
    const rate = sent / Math.max(0.001, (performance.now() - this.began) / 1000);
    this.text.textContent = `${formatBytes(sent)} of ${formatBytes(this.total)}, ${formatBytes(rate)}/s`;
  }
}
