import { describe, expect, it } from 'vitest';
import type { Placement } from '@/volume/geometry';
import { Zoom } from '@/volume/zoom';

const whole: Placement = [2, 0, 0, 2, 10, 20];

describe('an enlarged slice', () => {
  it('keeps the point under the pointer where it is', () => {
    const zoom = new Zoom();
    const at = { x: 0.25, y: 0.75 };
    const [, , , , e, f] = zoom.placed(whole, 200, 100);
    const sample = [(50 - e) / 2, (75 - f) / 2];
    zoom.by(3, at);
    const [a, , , d, x, y] = zoom.placed(whole, 200, 100);
    expect([a * (sample[0] ?? 0) + x, d * (sample[1] ?? 0) + y]).toEqual([50, 75]);
    zoom.by(1 / 3, at);
    expect(zoom.placed(whole, 200, 100)).toEqual(whole);
  });

  it('is never smaller than the whole, and never moved away', () => {
    const zoom = new Zoom();
    zoom.by(0.1);
    zoom.pan(5, 5);
    expect(zoom.placed(whole, 200, 100)).toEqual(whole);
    zoom.by(2);
    zoom.pan(99, -99);
    expect(zoom.placed([200, 0, 0, 100, 0, 0], 200, 100)).toEqual([400, 0, 0, 200, 0, -100]);
    zoom.by(1e6);
    expect(zoom.scale).toBe(24);
    zoom.reset();
    expect(zoom.placed(whole, 200, 100)).toEqual(whole);
  });
});
