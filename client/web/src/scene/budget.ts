// How long frames take, and what follows from it.

const slowFrame = 45; // milliseconds
const keptFrames = 120;

export class FrameBudget {
  // Durations of the last frames while the surface was moving, for measurements.
  readonly moving: number[] = [];
  private cost = 0;
  private later = 0;
  private lastEnd = 0;

  // A frame that began then is done.
  drawn(began: number, isMoving: boolean): void {
    const now = performance.now();
    const took = now - began;
    this.cost = this.cost === 0 ? took : 0.6 * this.cost + 0.4 * took;
    this.lastEnd = now;
    if (!isMoving) return;
    this.moving.push(took);
    if (this.moving.length > keptFrames) this.moving.shift();
  }

  get isSlow(): boolean {
    return this.cost > slowFrame;
  }

  // Runs it when drawing has left the page some time for other things; several calls become one.
  soon(run: () => void): void {
    if (this.later !== 0) return;
    const rest = Math.max(0, this.lastEnd + 3 * this.cost - performance.now());
    this.later = window.setTimeout(() => {
      this.later = 0;
      run();
    }, rest);
  }
}
