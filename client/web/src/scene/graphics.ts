// Before its first context a browser starts what draws for it, and whoever asks for one waits: some tenths of a second
// where software draws. A worker waits instead of the page.
let started: Promise<void> | null = null;

// Resolves when that has been waited for; also where no worker can ask for one.
export function graphicsStarted(): Promise<void> {
  started ??= new Promise((resolve) => {
    const worker = new Worker(new URL('./graphics.worker.ts', import.meta.url), { type: 'module' });
    worker.onmessage = worker.onerror = () => {
      worker.terminate();
      resolve();
    };
  });
  return started;
}
