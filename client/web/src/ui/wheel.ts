// Wheels turn in notches of about 100 pixels. Trackpads send many small distances instead, and pinches come as a wheel with Ctrl.
type Wheel = Pick<WheelEvent, 'deltaY' | 'deltaMode'>;

// For a deltaMode of pixels, lines (of which Firefox has three in a notch) and pages.
const pixelsPer = [1, 33, 100];
const pixelsPerStep = 25;
// A notch enlarges by that; a pinch is precise.
const mostZoom = Math.log(1.1);

function pixelsOf({ deltaY, deltaMode }: Wheel): number {
  return deltaY * (pixelsPer[deltaMode] ?? 1);
}

// Steps of one thing that a wheel moves.
export class WheelSteps {
  private rest = 0;

  // A notch is one step; smaller distances add up to one.
  steps(event: Wheel): number {
    const pixels = Math.max(-pixelsPerStep, Math.min(pixelsPerStep, pixelsOf(event)));
    this.rest = (this.rest * pixels < 0 ? 0 : this.rest) + pixels;
    if (Math.abs(this.rest) < pixelsPerStep) return 0;
    const step = Math.sign(this.rest);
    this.rest -= step * pixelsPerStep;
    return step;
  }
}

// How many times larger a wheel with Ctrl, or a pinch, makes what is seen.
export function wheelZoom(event: Wheel): number {
  return Math.exp(Math.max(-mostZoom, Math.min(mostZoom, -pixelsOf(event) / 100)));
}
