import { describe, expect, it } from 'vitest';
import { angleAt, areaOf, measureText } from '@/volume/measure';
import { pixelsOf, placeText, windowName } from '@/views/slices/slice_looks';
import { seenText } from '@/views/slices/slice_readout';
import { plainValue, profileOf, statisticsIn } from '@/volume/exact';
import { SliceMeasures } from '@/views/slices/slice_measure';
import { slicePlane } from '@/volume/geometry';
import type { Volume } from '@/api/types';

const volume = {
  dims: [10, 10, 10],
  spacing: [2, 3, 4],
  origin: [0, 0, 0],
  direction: [1, 0, 0, 0, 1, 0, 0, 0, 1],
} as unknown as Volume;

describe('what is measured in slices', () => {
  it('is in millimetres and degrees, wherever the plane lies', () => {
    expect(angleAt([1, 0, 0], [0, 0, 0], [0, 5, 0])).toBeCloseTo(90);
    expect(angleAt([1, 0, 0], [0, 0, 0], [-2, 0, 0])).toBeCloseTo(180);
    expect(areaOf([[0, 0, 7], [4, 0, 7], [4, 3, 7], [0, 3, 7]])).toBeCloseTo(12);
    // Not convex: an L.
    expect(areaOf([[0, 0, 0], [0, 2, 0], [0, 2, 1], [0, 1, 1], [0, 1, 2], [0, 0, 2]])).toBeCloseTo(3);
    expect(measureText('length', [[0, 0, 0], [3, 4, 0]])).toBe('5 mm');
    expect(measureText('angle', [[0, 0, 0], [3, 4, 0]])).toBe('');
  });

  it('belongs to its slice, takes the spacing, and is taken back', () => {
    const measures = new SliceMeasures();
    const plane = slicePlane(volume, 'axial');
    const texts = (index: number): string[] => measures.textsOf(volume, plane, index, () => null).map(({ text }) => text);
    expect(measures.take('axial', 5, [1, 1])).toBe(false);
    measures.kind.value = 'length';
    expect(measures.take('axial', 5, [1, 1])).toBe(true);
    expect(texts(5)).toEqual(['']);
    measures.take('axial', 5, [1, 3]);
    expect([texts(5), texts(6)]).toEqual([['6 mm'], []]);
    // One that was begun elsewhere and left is gone.
    measures.take('axial', 6, [0, 0]);
    measures.take('axial', 5, [0, 0]);
    measures.take('axial', 5, [5, 0]);
    expect([texts(5), texts(6)]).toEqual([['6 mm', '10 mm'], []]);
    measures.kind.value = 'area';
    for (const point of [[0, 0], [2, 0], [2, 2], [0, 2], [0, 2]] as const) measures.take('axial', 5, point);
    expect(measures.finish()).toBe(true);
    expect(texts(5).at(-1)).toBe('24 mm\u00b2');
    measures.takeBack();
    expect(texts(5)).toHaveLength(2);
    measures.clear();
    expect(texts(5)).toEqual([]);
  });

  it('has its text below all of its points, in the picture', () => {
    const grounds = (points: readonly (readonly [number, number])[]): number[][] => {
      const rects: number[][] = [];
      const known: Record<string, unknown> = {
        canvas: { width: 200, height: 100 },
        getTransform: () => ({ transformPoint: (point: unknown) => point }),
        measureText: () => ({ width: 50 }),
        fillRect: (...rect: number[]) => rects.push(rect),
      };
      const context = new Proxy(known, { get: (own, name: string) => own[name] ?? ((): void => undefined) });
      new SliceMeasures().paint(context as unknown as CanvasRenderingContext2D, 1, [{ points, text: '6 mm', isClosed: true }]);
      return rects.slice(points.length);
    };
    // The last point is at the top.
    const [[x = 0, y = 0] = []] = grounds([[10, 10], [10, 50], [40, 40], [40, 5]]);
    expect(x).toBeGreaterThan(10);
    expect(y).toBeGreaterThan(52);
    const [[left = 0, top = 0, width = 0, height = 0] = []] = grounds([[10, 10], [195, 99]]);
    expect([left + width <= 200, top + height <= 100]).toEqual([true, true]);
  });
});

describe('the looks of slices', () => {
  it('are colours for each grey, from the darkest to the brightest', () => {
    expect(pixelsOf('grey')[128]).toBe(0xff80_8080);
    expect(pixelsOf('inverted')[0]).toBe(0xffff_ffff);
    for (const name of ['hot', 'even'] as const) {
      const sums = [...pixelsOf(name)].map((pixel) => (pixel & 255) + ((pixel >> 8) & 255) + ((pixel >> 16) & 255));
      expect(sums[255]).toBeGreaterThan((sums[0] ?? 0) + 300);
    }
  });

  it('tell which window is shown', () => {
    const usual: [number, number] = [-1023.456, 1500];
    expect([windowName([0, 80], usual), windowName(usual, usual), windowName([-1023.46, 1500], usual)]).toEqual(['Brain', 'Usual', 'Usual']);
    expect(windowName([0, 81], usual)).toBe('');
  });

  it('tell values as exactly as eight bits do', () => {
    const seen = (value: number, window: [number, number]): string => seenText({ axis: 'z', index: 0, width: 1, height: 1, values: Uint8Array.of(value), window }, 0, 0);
    expect(seen(127, [1_000_000, 1_000_009])).toBe('about 1\u202f000\u202f004.48');
    expect(seen(0, [1_000_000, 1_000_009])).toBe('at most 1\u202f000\u202f000.02');
    expect(seen(66, [-1000, 3000])).toBe('about 40');
    expect([0, 51, 255].map((value) => seen(value, [-100, 155]))).toEqual(['at most \u221299.5', 'about \u221249', 'at least 154.5']);
  });

  it('tell places in either space', () => {
    expect(placeText([1, -2, 3.04], 'LPS', [2, 3, 4])).toBe('LPS 1, \u22122, 3 mm');
    expect(placeText([1, -2, 3.04], 'RAS', [2, 3, 4])).toBe('RAS \u22121, 2, 3 mm');
  });
});

describe('exact samples of a slice', () => {
  // Column plus ten times the row.
  const slice = { width: 10, height: 10, samples: Int16Array.from({ length: 100 }, (_, at) => at) };

  it('have a profile along a line', () => {
    expect(profileOf(slice, [[0, 0], [2, 2]])).toEqual([0, 1, 2, 3, 4, 5, 6].map((step) => expect.closeTo((step * 11) / 3) as number));
  });

  it('have a mean, a deviation and ends within an area', () => {
    const square = [[0.5, 0.5], [2.5, 0.5], [2.5, 2.5], [0.5, 2.5]] as const;
    expect(statisticsIn(slice, square)).toEqual({ count: 4, mean: 16.5, deviation: expect.closeTo(Math.sqrt(25.25)) as number, least: 11, greatest: 22 });
    expect(statisticsIn(slice, square.map(([x, y]) => [x / 10 + 0.3, y / 10 + 0.3] as const))).toBe(null);
  });

  it('are as short as tells them apart', () => {
    expect(plainValue(Math.fround(0.1), { samples: new Float32Array(1) })).toBe(0.1);
    expect(plainValue(0.1 + 0.2, { samples: new Float64Array(1) })).toBe(0.1 + 0.2);
  });
});
