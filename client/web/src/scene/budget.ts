// How long frames take, and what follows from it.

const slowFrame = 33; // milliseconds
const keptFrames = 120;
const stepTime = 60;
const mostSteps = 64;
const longestRest = 500;

export class FrameBudget {
  // Durations of the last frames while the surface was moving, for measurements.
  readonly moving: number[] = [];
  private cost = 0;
  // The cost of frames that show all triangles.
  private wholeCost = 0;
  private later = 0;
  private lastEnd = 0;

  // A frame that began then is done.
  drawn(began: number, { isMoving, isCoarse }: { isMoving: boolean; isCoarse: boolean }): void {
    const now = performance.now();
    const took = now - began;
    const mean = (before: number): number => (before === 0 ? took : 0.6 * before + 0.4 * took);
    this.cost = mean(this.cost);
    if (!isCoarse) this.wholeCost = mean(this.wholeCost);
    this.lastEnd = now;
    if (!isMoving) return;
    this.moving.push(took);
    if (this.moving.length > keptFrames) this.moving.shift();
  }

  // How many steps a frame of all triangles is drawn in, so that a change never waits for all of it.
  get steps(): number {
    return this.isSlow ? Math.min(mostSteps, Math.ceil(this.wholeCost / stepTime)) : 1;
  }

  get isSlow(): boolean {
    return this.wholeCost > slowFrame;
  }

  // Runs it when drawing has left the page some time for other things; several calls become one.
  soon(run: () => void): void {
    if (this.later !== 0) return;
    const rest = Math.max(0, this.lastEnd + Math.min(longestRest, 3 * this.cost) - performance.now());
    this.later = window.setTimeout(() => {
      this.later = 0;
      run();
    }, rest);
  }
}
