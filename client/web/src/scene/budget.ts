// How long frames take, and what follows from it.

const slowFrame = 33; // milliseconds
const stepTime = 60;
const mostSteps = 64;
const longestRest = 500;
// From one frame to the next while it moves: what is longer takes less effort, what is shorter leaves time for more. A screen shows
// at most 60 frames a second.
const slowPace = 33.5;
const quickPace = 20;
const judgedFrames = 4;
// About how much less each effort takes than the one before.
const gain = 0.75;

// What a frame takes while it moves, where all triangles and all pixels take too long.
export interface Effort {
  // The most triangles.
  triangles: number;
  // The part of the pixels along each side.
  sharpness: number;
}

export const efforts: readonly Effort[] = [
  { triangles: 64_000, sharpness: 1 },
  { triangles: 32_000, sharpness: 0.85 },
  { triangles: 32_000, sharpness: 0.7 },
  { triangles: 16_000, sharpness: 0.6 },
  { triangles: 16_000, sharpness: 0.5 },
  { triangles: 16_000, sharpness: 0.42 },
  { triangles: 16_000, sharpness: 0.35 },
  { triangles: 16_000, sharpness: 0.25 },
];
const firstEffort = 2;

interface DrawnFrame {
  began: number;
  isMoving: boolean;
  isCoarse: boolean;
  // It was waited for when the last one was done, so that nothing but drawing held it up.
  isNext: boolean;
}

export class FrameBudget {
  private cost = 0;
  // The cost of frames that show all triangles.
  private wholeCost = 0;
  private later = 0;
  private lastEnd = 0;

  private place = firstEffort;
  // One that was too slow in this move.
  private tooMuch = -1;
  private paces: number[] = [];

  get effort(): Effort {
    return efforts[this.place] as Effort;
  }

  // A move begins.
  begin(): void {
    this.tooMuch = -1;
    this.paces = [];
  }

  drawn({ began, isMoving, isCoarse, isNext }: DrawnFrame, now = performance.now()): void {
    const took = now - began;
    const mean = (before: number): number => (before === 0 ? took : 0.6 * before + 0.4 * took);
    this.cost = mean(this.cost);
    if (!isCoarse) this.wholeCost = mean(this.wholeCost);
    if (isMoving && isCoarse) this.judge(isNext ? now - this.lastEnd : took);
    this.lastEnd = now;
  }

  private judge(pace: number): void {
    this.paces.push(pace);
    if (this.paces.length < judgedFrames) return;
    const mean = this.paces.reduce((sum, one) => sum + one, 0) / judgedFrames;
    this.paces = [];
    if (mean > slowPace) {
      this.tooMuch = this.place;
      const steps = Math.ceil(Math.log(slowPace / mean) / Math.log(gain));
      this.place = Math.min(efforts.length - 1, this.place + steps);
    } else if (mean < quickPace && this.place - 1 > this.tooMuch) {
      this.place -= 1;
    }
  }

  // Counts a frame that was drawn while it moved, of a coarse copy or, where that is null, of all.
  note(dataset: DOMStringMap, triangles: number | null): void {
    dataset.frames = String(Number(dataset.frames ?? 0) + 1);
    dataset.effort = triangles === null ? 'all' : `${triangles} triangles, ${this.effort.sharpness} of the pixels along each side`;
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
