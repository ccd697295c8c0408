import { describe, expect, it } from 'vitest';
import { kindOf, withKind } from '@/job/kinds';
import { defaultParameters } from '@/job/parameters';
import { isForPrinting } from '@/job/printing';
import { withLabels } from '@/job/table';

const defaults = defaultParameters('a', 60);
const spacing = [0.5, 0.5, 1];

describe('the kinds of a surface', () => {
  it('are told by the parameters, and back', () => {
    expect(kindOf(defaults)).toBe('smooth');
    for (const kind of ['scanned', 'printing', 'smooth', 'printing', 'scanned'] as const) {
      expect(kindOf(withKind(withKind(defaults, 'printing', spacing), kind, spacing))).toBe(kind);
      expect(kindOf(withKind(withLabels(defaults, 'all'), kind, spacing))).toBe(kind);
    }
  });

  it('leave alone what has nothing to do with them', () => {
    const own = { ...defaults, passes: 9, max_error_mm: 0.3, formats: ['glb', 'ply'] } as typeof defaults;
    const printed = withKind(own, 'printing', spacing);
    expect(printed).toMatchObject({ passes: 9, max_error_mm: 0.3, close: true });
    expect(printed.formats).toEqual(expect.arrayContaining(['ply', 'stl', '3mf']));
    expect(withKind(printed, 'smooth', spacing)).toEqual(own);
  });

  it('make a print of one closed component within a proven error, and take all of it back', () => {
    const printed = withKind(defaults, 'printing', spacing);
    expect(printed).toMatchObject({ close: true, fill_cavities: true, smoothing: 'taubin', max_error_mm: 0.2, components: { keep: 1 } });
    expect(withKind(defaults, 'printing', [0.1, 0.1, 0.1]).max_error_mm).toBe(0.05);
    expect(withKind(printed, 'smooth', spacing)).toEqual(defaults);
    // Labels have no parameters for components and cavities, and their own smoothing.
    const labels = withLabels(defaults, 'all');
    const printedLabels = withKind(labels, 'printing', spacing);
    expect(printedLabels).toMatchObject({ smoothing: 'labels', max_error_mm: 0.2, components: labels.components });
    expect(printedLabels.fill_cavities).toBe(labels.fill_cavities);
    expect(withKind(printedLabels, 'smooth', spacing)).toEqual(labels);
  });
});

describe('a surface that was made for a printer', () => {
  it('is one for it if it encloses a volume, which a closed one that is inside out does not', () => {
    const parameters = withKind(defaults, 'printing', spacing);
    const made = (quality: object): boolean => isForPrinting({ parameters, mesh: { quality } } as never);
    expect(made({ closed: true, oriented: true, encloses_volume: true })).toBe(true);
    expect(made({ closed: true, oriented: true, encloses_volume: false })).toBe(false);
    expect(isForPrinting({ parameters, mesh: null } as never)).toBe(false);
  });
});
