import { describe, expect, it } from 'vitest';
import { formatMilliseconds, formatNumber, formatValue } from '@/ui/format';
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
    expect(placeText([0, 0, -0.01], 'LPS')).toBe('LPS 0, 0, 0 mm');
    expect(placeText([0, 0.01, 5], 'RAS')).toBe('RAS 0, 0, 5 mm');
  });
});
