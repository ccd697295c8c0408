import { describe, expect, it } from 'vitest';
import { contour, type Samples } from '@/volume/contour';

function samples(width: number, height: number, value: (x: number, y: number) => number): Samples {
  const values = Array.from({ length: width * height }, (_, i) => value(i % width, Math.floor(i / width)));
  return { width, height, values };
}

function ends(segments: Float32Array): string[] {
  const points: string[] = [];
  for (let i = 0; i < segments.length; i += 2) points.push(`${segments[i]?.toFixed(4)},${segments[i + 1]?.toFixed(4)}`);
  return points;
}

describe('contour', () => {
  it('is empty where all samples lie on one side', () => {
    expect(contour(samples(4, 4, () => 5), 6).length).toBe(0);
    expect(contour(samples(4, 4, () => 5), 5).length).toBe(0);
  });

  it('lies where the values cross, between the samples', () => {
    const segments = contour(samples(2, 2, (x) => 10 * x), 2.5);
    expect(ends(segments).sort()).toEqual(['0.2500,0.0000', '0.2500,1.0000']);
  });

  it('has a sample at the iso-value inside', () => {
    const at = samples(3, 3, (x, y) => (x === 1 && y === 1 ? 7 : 0));
    expect(contour(at, 7).length).toBe(4 * 4);
    expect(contour(at, 7.001).length).toBe(0);
  });

  it('closes around a disc, with its length and its radius', () => {
    const radius = 20;
    const disc = samples(64, 64, (x, y) => radius - Math.hypot(x - 31.3, y - 30.8));
    const segments = contour(disc, 0);
    let length = 0;
    for (let i = 0; i < segments.length; i += 4) {
      const [x0 = 0, y0 = 0, x1 = 0, y1 = 0] = segments.subarray(i, i + 4);
      length += Math.hypot(x1 - x0, y1 - y0);
      expect(Math.hypot(x0 - 31.3, y0 - 30.8)).toBeCloseTo(radius, 1);
    }
    expect(length / (2 * Math.PI * radius)).toBeCloseTo(1, 2);
    const counts = new Map<string, number>();
    for (const end of ends(segments)) counts.set(end, (counts.get(end) ?? 0) + 1);
    expect([...counts.values()].every((count) => count === 2)).toBe(true);
  });

  it('joins every crossed edge of a checkerboard once in each cell', () => {
    const board = samples(9, 9, (x, y) => (x + y) % 2);
    const counts = new Map<string, number>();
    for (const end of ends(contour(board, 0.5))) counts.set(end, (counts.get(end) ?? 0) + 1);
    expect(counts.size).toBe(2 * 9 * 8);
  });
});
