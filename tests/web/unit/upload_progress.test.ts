import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';

beforeEach(() => {
  vi.useFakeTimers();
  const element = (): unknown => ({ setAttribute: () => undefined, removeAttribute: () => undefined, append: () => undefined, textContent: '', value: 0 });
  vi.stubGlobal('document', { createElement: element });
  vi.stubGlobal('window', { setTimeout });
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

describe('the progress of an upload', () => {
  it('says that it waits when nothing moves, and goes on when it does', async () => {
    const { UploadProgress } = await import('@/views/volumes/upload_progress');
    const progress = new UploadProgress(1_000_000);
    progress.show(200_000);
    expect(progress.text.textContent).toMatch(/\/s$/);
    vi.advanceTimersByTime(3500);
    expect(progress.text.textContent).toMatch(/of .*\. Waiting for the server$/);
    progress.show(400_000);
    expect(progress.text.textContent).not.toContain('Waiting');
    progress.end();
    vi.advanceTimersByTime(10_000);
    expect(progress.text.textContent).not.toContain('Waiting');
  });

  it('says that the server is busy until something is sent again', async () => {
    const { UploadProgress } = await import('@/views/volumes/upload_progress');
    const progress = new UploadProgress(1_000_000);
    progress.show(200_000);
    progress.showBusy();
    vi.advanceTimersByTime(10_000);
    expect(progress.text.textContent).toBe('The server is busy. The upload is tried again automatically');
    progress.show(100_000);
    expect(progress.text.textContent).toMatch(/\/s$/);
    progress.end();
  });
});
