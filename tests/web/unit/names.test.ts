import { describe, expect, it } from 'vitest';
import type { Volume } from '@/api/types';
import { defaultParameters, surfaceInNames } from '@/job/parameters';
import { fileStem } from '@/volume/names';

describe('a file that is made of a volume', () => {
  const named = (name: string | null, series = ''): string =>
    fileStem({ name, dicom: { patient_name: 'Doe^Jane', series_description: series } } as Volume, 'surface-1');

  it('is called after it, in letters that every system takes, and never after the patient', () => {
    expect(named('ch2bet.nii.gz')).toBe('ch2bet');
    expect(named('T1 w\u00e9ighted / axial.nrrd')).toBe('T1-we-ighted-axial');
    expect(named(null, 'Abdomen 1.0 B30f')).toBe('Abdomen-1.0-B30f');
    expect(named('../../etc')).toBe('etc');
    expect(named(null)).toBe('surface-1');
    expect(fileStem(null, 'surface-1')).toBe('surface-1');
    expect(named('x'.repeat(200))).toHaveLength(60);
  });

  it('has plain digits in its name', () => {
    const nameAt = (iso: number): string => surfaceInNames(defaultParameters('v', iso));
    expect([-300, 1250, -1250.4, 0.25].map(nameAt)).toEqual(['iso--300', 'iso-1250', 'iso--1250', 'iso-0.25']);
    expect(surfaceInNames({ labels: 'all' })).toBe('all-labels');
  });
});
