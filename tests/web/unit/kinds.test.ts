import { describe, expect, it } from 'vitest';
import { kindOf, withKind } from '@/job/kinds';
import { defaultParameters } from '@/job/parameters';
import { withLabels } from '@/job/table';

const defaults = defaultParameters('a', 60);

describe('the kinds of a surface', () => {
  it('are told by the parameters, and back', () => {
    expect(kindOf(defaults)).toBe('smooth');
    for (const kind of ['scanned', 'printing', 'smooth', 'printing', 'scanned'] as const) {
      expect(kindOf(withKind(withKind(defaults, 'printing'), kind))).toBe(kind);
      expect(kindOf(withKind(withLabels(defaults, 'all'), kind))).toBe(kind);
    }
  });

  it('leave alone what has nothing to do with them', () => {
    const own = { ...defaults, passes: 9, max_error_mm: 0.2, formats: ['glb', 'ply'] } as typeof defaults;
    const printed = withKind(own, 'printing');
    expect(printed).toMatchObject({ passes: 9, max_error_mm: 0.2, close: true });
    expect(printed.formats).toEqual(expect.arrayContaining(['ply', 'stl', '3mf']));
    expect(withKind(printed, 'smooth')).toEqual(own);
  });
});
