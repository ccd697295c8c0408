import { describe, expect, it } from 'vitest';
import type { Volume } from '@/api/types';
import { foundVolumes } from '@/views/volumes/volume_search';
import { noteTexts } from '@/volume/names';
import { sampleHead } from '@/volume/sample';
import { mayBeVolume } from '@/volume/sniff';

const volumes = [
  { id: 'a', name: 'knee 10', bytes: 5, modality: 'MR', dims: [1, 2, 3] },
  { id: 'b', name: 'Knee 9', bytes: 50, modality: 'CT', dims: [1, 2, 3] },
  { id: 'c', name: null, bytes: 20, modality: null, format: 'nrrd', dims: [7, 8, 9], dicom: { patient_id: 'P-77' } },
] as unknown as Volume[];
const ids = (text: string, order: string): string => foundVolumes(volumes, text, order).map(({ id }) => id).join('');

describe('volumes', () => {
  it('are found by all of the words, in name, kind and patient', () => {
    expect(['', 'KNEE', 'knee ct', 'nrrd', '7 × 8', 'p-77', 'elbow'].map((text) => ids(text, 'newest'))).toEqual(['abc', 'ab', 'b', 'c', 'c', 'c', '']);
  });

  it('are sorted', () => {
    expect([ids('', 'newest'), ids('knee', 'name'), ids('', 'size'), ids('', 'nonsense')]).toEqual(['abc', 'ba', 'bca', 'abc']);
  });
});

describe('the notes of a volume', () => {
  const notes = [
    { code: 'looks-like-labels', detail: 'The samples look like labels.' },
    { code: 'unit-unknown', detail: 'The unit is unknown.' },
  ];
  const textsOf = (type: string): string[] => noteTexts({ type, range: [0, 5], notes } as unknown as Volume);

  it('name the button for labels where there is one', () => {
    expect(textsOf('uint8')).toEqual([
      'The samples look like labels. The button "Each label" makes one surface for each label.',
      'The unit is unknown.',
    ]);
    expect(textsOf('float32')).toEqual(notes.map(({ detail }) => detail));
  });
});

describe('the sample', () => {
  it('is a volume that holds all that its header tells, with bone and air in it', async () => {
    const { file } = sampleHead();
    const bytes = new Uint8Array(await file.arrayBuffer());
    expect(await mayBeVolume(file)).toBe(true);
    const header = new TextDecoder().decode(bytes.slice(0, 4096)).split('\n\n', 1)[0] ?? '';
    expect(header).toContain('sizes: 112 112 112');
    expect(file.size).toBe(header.length + 2 + 2 * 112 ** 3);
    const samples = new Int16Array(bytes.buffer.slice(bytes.length - 2 * 112 ** 3));
    expect([Math.min(...samples.subarray(0, 5000)), samples.reduce((most, value) => Math.max(most, value))]).toEqual([-1000, 950]);
  });
});
