import { describe, expect, it } from 'vitest';
import type { Job, JobParameters } from '@/api/types';
import { withShownGlb } from '@/job/parameters';
import { viewableFile, whyNotShown } from '@/mesh/shown';

function job(formats: string[], parameters: Partial<JobParameters> = {}): Job {
  const files = Object.fromEntries(formats.map((format) => [format, { bytes: 1, sha256: format, href: `/mesh.${format}` }]));
  return { parameters: { formats, ...parameters }, mesh: { files } } as unknown as Job;
}

function shown(formats: string[], parameters: Partial<JobParameters> = {}): string | undefined {
  return viewableFile(job(formats, parameters))?.format;
}

describe('the file that the page shows', () => {
  it('is GLB with the codec draco or none', () => {
    expect(shown(['glb'])).toBe('glb');
    expect(shown(['glb'], { glb_codec: 'draco', space: 'ras' })).toBe('glb');
    expect(shown(['glb'], { glb_codec: 'none' })).toBe('glb');
    for (const codec of ['quantized', 'meshopt', 'khr-meshopt'] as const) expect(shown(['glb', 'stl'], { glb_codec: codec })).toBeUndefined();
  });

  it('is Draco in the space of the slices if there is no such GLB', () => {
    expect(shown(['drc'])).toBe('drc');
    expect(shown(['drc', 'glb'])).toBe('glb');
    expect(shown(['drc', 'glb'], { glb_codec: 'meshopt' })).toBe('drc');
    expect(shown(['drc'], { space: 'ras' })).toBeUndefined();
  });

  it('is Draco instead of a GLB with ten times the bytes, if it has all that the GLB has', () => {
    const plain = { glb_codec: 'none' } as const;
    expect(shown(['drc', 'glb'], plain)).toBe('drc');
    expect(shown(['drc', 'glb'], { ...plain, lods: [1] })).toBe('drc');
    expect(shown(['drc', 'glb'], { ...plain, space: 'ras' })).toBe('glb');
    expect(shown(['drc', 'glb'], { ...plain, distances: true })).toBe('glb');
    expect(shown(['drc', 'glb'], { ...plain, lods: [1, 0.5] })).toBe('glb');
    expect(shown(['drc', 'glb'], { ...plain, labels: 'all' })).toBe('glb');
  });
});

describe('a job without a file that the page shows', () => {
  it('says what it has and what the page shows', () => {
    const begin = 'The page shows GLB with the codec draco or none, and Draco in LPS. This job has';
    expect(whyNotShown(job(['glb', 'stl'], { glb_codec: 'khr-meshopt' }))).toBe(`${begin} GLB with the codec khr-meshopt only.`);
    expect(whyNotShown(job(['drc'], { space: 'ras' }))).toBe(`${begin} Draco in RAS only.`);
    expect(whyNotShown(job(['stl', 'ply']))).toBe(`${begin} STL, PLY only.`);
  });

  it('is made again with one', () => {
    const { parameters } = job(['stl'], { glb_codec: 'meshopt' });
    expect(withShownGlb(parameters)).toEqual({ formats: ['glb', 'stl'], glb_codec: 'draco' });
    expect(withShownGlb({ ...parameters, glb_codec: 'none' }).glb_codec).toBe('none');
  });
});
