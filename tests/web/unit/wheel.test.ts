import { describe, expect, it } from 'vitest';
import { WheelSteps, wheelZoom } from '@/ui/wheel';

const steps = (events: readonly number[], deltaMode = 0): number => {
  const wheel = new WheelSteps();
  return events.reduce((sum, deltaY) => sum + wheel.steps({ deltaY, deltaMode }), 0);
};

describe('a wheel', () => {
  it('moves a step for each notch, of any system', () => {
    expect(steps([100, 100, -120])).toBe(1);
    expect(steps([3, 3], 1)).toBe(2);
    expect(steps([1], 2)).toBe(1);
  });

  it('of a trackpad counts by its distance', () => {
    expect(steps(Array<number>(40).fill(2))).toBe(3);
    expect(steps(Array<number>(40).fill(-2))).toBe(-3);
    // Turning back does not have to make up for what was left.
    expect(steps([24, -25])).toBe(-1);
  });

  it('enlarges by 1.6 in five notches, and by a pinch as far as the fingers go', () => {
    expect(wheelZoom({ deltaY: -120, deltaMode: 0 }) ** 5).toBeCloseTo(1.61, 2);
    expect(wheelZoom({ deltaY: -3, deltaMode: 1 }) ** 5).toBeCloseTo(1.61, 2);
    expect(wheelZoom({ deltaY: -5, deltaMode: 0 })).toBeCloseTo(Math.exp(0.05), 6);
  });
});
