import { describe, expect, it } from 'vitest';
import { barHeights, defaultWindow, niceStep, quantile, ticks } from '@/volume/histogram';

const even = { range: [0, 100] as [number, number], counts: Array.from({ length: 10 }, () => 10) };

describe('histogram', () => {
  it('has the heights of its bars between 0 and 1, in order', () => {
    const heights = barHeights([0, 1, 10, 1_000_000]);
    expect(heights[0]).toBe(0);
    expect(heights[3]).toBe(1);
    expect([...heights].sort((a, b) => a - b)).toEqual(heights);
    // A bin of a millionth of the largest is still seen.
    expect(heights[1]).toBeGreaterThan(0.04);
    expect(barHeights([0, 0])).toEqual([0, 0]);
  });

  it('finds quantiles within bins', () => {
    expect(quantile(even, 0)).toBe(0);
    expect(quantile(even, 0.25)).toBeCloseTo(25);
    expect(quantile(even, 1)).toBeCloseTo(100);
  });

  it('opens a window that outliers do not stretch, but the iso-value does', () => {
    const counts = [...Array.from({ length: 99 }, () => 1000), 1];
    const outliers = { range: [0, 100] as [number, number], counts };
    expect(defaultWindow(outliers, 50)[1]).toBeLessThan(99);
    expect(defaultWindow(outliers, 99.5)[1]).toBe(99.5);
    const flat = defaultWindow({ range: [5, 5], counts: [8] }, 5);
    expect(flat[1]).toBeGreaterThan(flat[0]);
  });

  it('steps by round values, whole for whole samples', () => {
    expect(niceStep([-1024, 3071], true)).toBe(10);
    expect(niceStep([0, 255], true)).toBe(1);
    expect(niceStep([0, 1], false)).toBeCloseTo(0.001);
    expect(niceStep([3, 3], false)).toBe(1);
  });

  it('labels round values within the range', () => {
    expect(ticks([-1024, 3071], 5)).toEqual([-1000, 0, 1000, 2000, 3000]);
    expect(ticks([0, 1], 4)).toHaveLength(3);
    expect(ticks([2, 2], 5)).toEqual([2]);
  });
});
