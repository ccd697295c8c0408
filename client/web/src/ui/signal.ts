// A value that tells those who listen when it changes.
export class Signal<T> {
  private readonly listeners = new Set<(value: T) => void>();

  constructor(private current: T) {}

  get value(): T {
    return this.current;
  }

  set value(next: T) {
    if (Object.is(next, this.current)) return;
    this.current = next;
    for (const listener of [...this.listeners]) listener(next);
  }

  // Returns how to stop listening.
  subscribe(listener: (value: T) => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  // As subscribe, and calls once now.
  watch(listener: (value: T) => void): () => void {
    listener(this.current);
    return this.subscribe(listener);
  }
}

// Ends a view's listeners, timers and requests when a person leaves the view.
export class Scope {
  private readonly ends: (() => void)[] = [];
  private readonly controller = new AbortController();

  get signal(): AbortSignal {
    return this.controller.signal;
  }

  get isOver(): boolean {
    return this.controller.signal.aborted;
  }

  onEnd(end: () => void): void {
    if (this.isOver) end();
    else this.ends.push(end);
  }

  listen<K extends keyof WindowEventMap>(
    target: EventTarget,
    name: K | string,
    handler: (event: WindowEventMap[K]) => void,
    options: AddEventListenerOptions = {},
  ): void {
    // A wheel's listener stops the page from scrolling.
    target.addEventListener(name, handler as EventListener, { passive: false, ...options, signal: this.signal });
  }

  // Calls it so often while the page is seen, but not before it has ended: it may wait for a busy server. A lost connection
  // is said at the top of the page.
  repeat(milliseconds: number, refresh: () => Promise<void>): void {
    let isRunning = false;
    const run = async (): Promise<void> => {
      if (document.hidden || isRunning) return;
      isRunning = true;
      await refresh().catch(() => undefined);
      isRunning = false;
    };
    const timer = setInterval(() => void run(), milliseconds);
    this.onEnd(() => clearInterval(timer));
  }

  end(): void {
    if (this.isOver) return;
    this.controller.abort();
    for (const end of this.ends.splice(0).reverse()) end();
  }
}
