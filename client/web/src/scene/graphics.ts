// What draws in 3D, which is loaded when it is needed, and its first context. Before that a browser starts what draws for it, and
// whoever asks for one waits: some tenths of a second where software draws. A worker waits instead of the page.
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

// Loads what draws surfaces, while their numbers are shown already.
export async function surfaceDrawing(): Promise<typeof import('./surface')> {
  const [drawing] = await Promise.all([import('./surface'), graphicsStarted()]);
  return drawing;
}
