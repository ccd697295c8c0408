import { describe, expect, it } from 'vitest';
import { lookOf, looksFor, sumsOf } from '@/volume/looks';

const window: [number, number] = [-1024, 1526]; // ten units a value

describe('looks through a volume', () => {
  it('are those for its modality, told by its values where nothing tells it', () => {
    const ct = ['bone', 'soft tissue', 'lung', 'airways'];
    expect(looksFor({ modality: 'CT', range: [0, 255] })).toEqual(ct);
    expect(looksFor({ modality: null, range: [-1024, 3000] })).toEqual(ct);
    expect(looksFor({ modality: null, range: [0, 255] })).toEqual(['MR']);
    expect(looksFor({ modality: 'MR', range: [-1000, 255] })).toEqual(['MR']);
  });

  it('show values by Hounsfield units, whatever the window is', () => {
    const opacityAt = (name: 'bone' | 'lung', units: number): number =>
      lookOf(name, window).table[4 * Math.round((units + 1024) / 10) + 3] ?? -1;
    expect([opacityAt('bone', 40), opacityAt('bone', 1450)]).toEqual([0, 230]);
    expect(opacityAt('bone', 800)).toBeGreaterThan(opacityAt('bone', 300));
    expect(opacityAt('lung', -700)).toBeGreaterThan(0);
    expect([opacityAt('lung', -1000), opacityAt('lung', 40)]).toEqual([0, 0]);
  });

  it('of MR go with the window', () => {
    expect(lookOf('MR', [0, 1]).table).toEqual(lookOf('MR', [-5, 4000]).table);
  });

  it('tell by sums whether anything between two values is seen', () => {
    const look = lookOf('bone', window);
    const sums = sumsOf(look);
    const water = Math.round(1024 / 10);
    expect(sums).toHaveLength(257);
    expect((sums[water + 1] ?? 0) - (sums[0] ?? 0)).toBe(0);
    expect((sums[256] ?? 0) - (sums[water] ?? 0)).toBeGreaterThan(0);
  });
});
