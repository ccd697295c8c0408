import { describe, expect, it } from 'vitest';
import { formatMilliseconds, formatNumber, formatSize, formatValue, shortened } from '@/ui/format';
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

describe('a value far from zero', () => {
  it('has the digits that tell it apart within its range', () => {
    expect(shortened(1_000_004.482_421_875, 9)).toBe(1_000_004.48242);
    expect(shortened(-1_000_004.482_421_875, 0.5)).toBe(-1_000_004.482422);
    expect(formatValue(1_000_004.482_421_875, 9)).toBe('1\u202f000\u202f004.48');
    expect(formatValue(1e6, 9)).toBe('1\u202f000\u202f000');
    expect([1.0001e-5, 1.0002e-5].map((value) => formatValue(value, 1e-9))).toEqual(['1.000100e-5', '1.000200e-5']);
  });

  it('has as few as ever in a wide range', () => {
    expect([shortened(250.5, 4095), shortened(300, 4e9), shortened(1 / 3, 1)]).toEqual([250.5, 300, 0.333333]);
    expect([250.5, 1234.5, 0.25].map((value) => formatValue(value, 4095))).toEqual([250.5, 1234.5, 0.25].map((value) => formatValue(value)));
    // Also where all samples are equal.
    expect([shortened(0, 9), shortened(12.3456789, 0), formatValue(12.3456, 0)]).toEqual([0, 12.3457, '12.35']);
  });
});
