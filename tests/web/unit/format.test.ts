import { describe, expect, it } from 'vitest';
import { formatMilliseconds, formatNumber, formatSize, formatValue } from '@/ui/format';
import { placeText } from '@/views/slices/slice_looks';

describe('a time', () => {
  it('goes to the next unit where rounding reaches it', () => {
    const said: [number, string][] = [
      [0.4, '< 1 ms'], [999.4, '999 ms'], [999.6, '1.00 s'], [9994, '9.99 s'], [9996, '10.0 s'], [59_949, '59.9 s'],
      [59_960, '1 min 0 s'], [119_400, '1 min 59 s'], [119_600, '2 min 0 s'], [125_000, '2 min 5 s'],
    ];
    for (const [milliseconds, text] of said) expect(formatMilliseconds(milliseconds)).toBe(text);
  });
});

describe('a number that is rounded to zero', () => {
  it('has no sign', () => {
    expect([formatNumber(-0.04, 1), formatNumber(-0, 1), formatValue(-0)]).toEqual(['0', '0', '0']);
    expect([formatNumber(-0.06, 1), formatValue(-0.5)]).toEqual(['\u22120.1', '\u22120.5']);
    expect(placeText([0, 0, -0.01], 'LPS', [1, 1, 1])).toBe('LPS 0, 0, 0 mm');
    expect(placeText([0, 0.01, 5], 'RAS', [1, 1, 1])).toBe('RAS 0, 0, 5 mm');
  });
});

describe('what is small', () => {
  it('is not rounded to nothing', () => {
    expect([0, 48.26, 1, 0.5, 0.03, 0.0412, 0.00000123].map(formatSize)).toEqual(['0', '48.3', '1', '0.5', '0.03', '0.0412', '1.23e-6']);
    expect(placeText([0.15, -0.16, 0.155], 'LPS', [0.01, 0.01, 0.01])).toBe('LPS 0.15, \u22120.16, 0.155 mm');
  });
});
