// How long frames take, and what follows from it.

const slowFrame = 33; // milliseconds
const keptFrames = 120;
const stepTime = 60;
const mostSteps = 64;
const longestRest = 500;
// A coarse frame within this leaves time for more pixels.
const quickFrame = 20;
const leastSharpness = 0.35;

export class FrameBudget {
  // Durations of the last frames while the surface was moving, for measurements.
  readonly moving: number[] = [];
  private cost = 0;
  // The cost of frames that show all triangles.
  private wholeCost = 0;
  private later = 0;
  private movingSharpness = 1;
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
    if (isCoarse) this.sharpen(took);
    this.moving.push(took);
    if (this.moving.length > keptFrames) this.moving.shift();
  }

  // How many steps a frame of all triangles is drawn in, so that a change never waits for all of it.
  get steps(): number {
    return this.isSlow ? Math.min(mostSteps, Math.ceil(this.wholeCost / stepTime)) : 1;
  }

  // The part of the canvas's pixels, along each side, that a coarse frame is drawn with: what keeps it within `slowFrame` where
  // pixels are what takes the time.
  get sharpness(): number {
    return this.movingSharpness;
  }

  // Down at once, but by one slow frame, which may have waited for something else, not to the least; up slowly.
  private sharpen(took: number): void {
    const factor = took > slowFrame ? Math.max(0.75, Math.sqrt(slowFrame / took)) : took < quickFrame ? 1.05 : 1;
    this.movingSharpness = Math.min(1, Math.max(leastSharpness, factor * this.movingSharpness));
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
