import { describe, expect, it } from 'vitest';
import { emptyReason } from '@/api/problem';
import { changeOf } from '@/job/changes';
import { millimetres } from '@/ui/format';
import { fromExtracted, histogramPath, referenceText, untangledText } from '@/views/jobs/certificate';
import { stepsOf, totalOf } from '@/views/jobs/charts';
import { errorAt, errorInWords, placeOf } from '@/views/prepare/error_slider';
import { keepOnlyAt } from '@/views/surface/component_list';

describe('the slider of the largest error', () => {
  it('is off at its left end, and goes from 0.02 to 2 mm in steps of the same factor', () => {
    expect(errorAt(0)).toBe(null);
    expect(errorAt(1)).toBe(0.02);
    expect(errorAt(60)).toBe(2);
    const all = Array.from({ length: 60 }, (_, place) => errorAt(place + 1) ?? 0);
    for (let i = 1; i < all.length; i += 1) {
      const factor = (all[i] ?? 0) / (all[i - 1] ?? 1);
      expect(factor).toBeGreaterThan(1.02);
      expect(factor).toBeLessThan(1.13);
    }
  });

  it('stands at the error that it gave, and at its ends for what lies beyond', () => {
    for (let place = 0; place <= 60; place += 1) expect(placeOf(errorAt(place))).toBe(place);
    expect([placeOf(0.001), placeOf(50)]).toEqual([1, 60]);
  });

  it('says the error beside the smallest spacing', () => {
    expect(errorInWords(null, [1, 1, 1])).toBe('off');
    expect(errorInWords(0.1, [1, 0.5, 2])).toBe('0.1 mm, 0.2 × the spacing of 0.5 mm');
    expect(errorInWords(0.02, [1.5, 1.5, 3])).toBe('0.02 mm, 0.013 × the spacing of 1.5 mm');
  });
});

describe('why a surface is empty', () => {
  it('is what the server says', () => {
    expect(emptyReason({ empty_reason: 'the chosen labels have no boundary' })).toBe('The surface is empty: the chosen labels have no boundary.');
    expect(emptyReason({})).toBe('The surface is empty.');
  });
});

describe('a certificate', () => {
  it('tells millimetres to three digits that count', () => {
    expect([0, 0.0001, 0.0123, 0.1234, 1.234, 12.34].map(millimetres)).toEqual(['0', '< 0.001', '0.012', '0.123', '1.23', '12.3']);
  });

  it('has its histograms over one axis, and shows a bin of a single point', () => {
    const histogram = [99, ...Array<number>(18).fill(0), 1] as never;
    const path = histogramPath({ points: 100, max_mm: 0.5, mean_mm: 0, rms_mm: 0, p99_mm: 0, histogram }, 1, 99);
    const places = [...path.matchAll(/L([\d.]+) ([\d.]+)/g)].map(([, x, y]) => [Number(x), Number(y)]);
    expect(Math.max(...places.map(([x]) => x ?? 0))).toBe(160);
    expect(places[1]).toEqual([8, 2]);
    const [, last] = places.at(-2) ?? [];
    expect(last).toBeLessThan(64 - 5);
    expect(histogramPath({ points: 1, max_mm: 0, mean_mm: 0, rms_mm: 0, p99_mm: 0, histogram }, 1, 99)).toBe('');
  });
});

describe('the distance from the extracted surface', () => {
  const displacement_mm = { max: 0.3, mean: 0.1 };
  const from = (certificate: object): unknown => fromExtracted({ certificate, displacement_mm } as never);

  it('has what smoothing moved, if it was measured from the smoothed surface', () => {
    expect(from({ reference: 'smoothed', bound_mm: 0.2, found_mm: 0.1 })).toEqual({ mm: 0.5, proven: true });
    expect(from({ reference: 'smoothed', found_mm: 0.1 })).toEqual({ mm: 0.4, proven: false });
    expect(from({ reference: 'extracted', bound_mm: 0.2, found_mm: 0.1 })).toEqual({ mm: 0.2, proven: true });
    expect(fromExtracted({ displacement_mm })).toBeNull();
  });

  it('names the surface that it was measured from', () => {
    expect(referenceText({ reference: 'smoothed' })).toBe('smoothed surface');
    expect(referenceText({ reference: 'extracted' })).toBe('extracted surface');
  });
});

describe('removing self-intersections', () => {
  it('is told with its pairs, what it moved, and what is left', () => {
    const text = (pairs: number, vertices: number, left: number): string => untangledText({ untangled: { pairs, vertices, left } });
    expect(text(0, 0, 0)).toBe('nothing intersected');
    expect(text(1, 4, 0)).toBe('1 pair of triangles, 4 vertices moved back');
    expect(text(1200, 3400, 2)).toMatch(/^1\D?200 pairs of triangles, 3\D?400 vertices moved back; 2 pairs of triangles intersect as extracted$/);
    expect(untangledText({})).toBe('');
  });
});

describe('the stages of a job', () => {
  it('are told without those that it did not have', () => {
    const timing = { queue: 1, load: 1, extract: 1, smooth: 0, simplify: 0, encode: 1, certify: 0, total: 4 };
    const names = (more: object): string[] => stepsOf({ ...timing, ...more }).map(({ name }) => name);
    expect(names({})).toEqual(['queue', 'load', 'extract', 'encode']);
    // Cancelled before it was extracted.
    expect(names({ extract: 0, smooth: 0, encode: 0 })).toEqual(['queue', 'load']);
    expect(names({ simplify: 2, certify: 3 })).toEqual(['queue', 'load', 'extract', 'simplify', 'encode', 'certify']);
  });
});

describe('a change of the surface', () => {
  it('is by smoothing only where nothing else changed it, and not told where nothing did', () => {
    const simplified = { triangles_before: 9, bound_by: 'error' } as const;
    const titles = [changeOf({ passes: 5 }, {}), changeOf({ passes: 5 }, { simplified }), changeOf({ passes: 0 }, { simplified })].map((change) => change?.title);
    expect(titles).toEqual(['Change by smoothing', 'Change since extraction', 'Change since extraction']);
    expect(changeOf({ passes: 0 }, {})).toBeNull();
  });
});

describe('the time of a job', () => {
  it('is the whole, also where a stage did not end', () => {
    const cancelled = { queue: 1, load: 12, extract: 0, smooth: 0, simplify: 0, encode: 0, certify: 0, total: 13_177 };
    expect(totalOf(cancelled)).toBe(13_177);
    expect(totalOf({ queue: 1, load: 12, total: 14 }, { transfer: 3, view: 2 })).toBe(19);
  });
});

describe('a part that was picked', () => {
  it('is kept alone, at its place', () => {
    expect(keepOnlyAt([1.23456789, -2, 3])).toEqual({
      components: { keep: null, min_triangles: null, nearest_to: [[1.234568, -2, 3]] },
    });
  });
});
