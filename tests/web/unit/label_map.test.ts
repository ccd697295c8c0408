import { describe, expect, it } from 'vitest';
import { coloursOf, LabelMap, lookOf, paintLabels, seriesColour, windowsOf, type LabelLook } from '@/volume/label_map';
import { firstLabel } from '@/volume/preview';

// What the daemon's picture of these samples would be.
function pictureOf(samples: readonly number[], [low, high]: readonly [number, number]): Uint8Array {
  return Uint8Array.from(samples, (sample) => Math.max(0, Math.min(255, Math.round((255 * (sample - low)) / (high - low)))));
}

const named = (...labels: number[]): LabelMap => new LabelMap(labels.map((label) => ({ label })));

describe('labels in pictures of eight bits', () => {
  it('need few windows, of which each label is in one', () => {
    expect(windowsOf([1, 2, 254])).toEqual([[0, 255]]);
    expect(windowsOf([1, 255])).toHaveLength(2);
    expect(windowsOf([2, 85, 1035, 1000, 2000, 2035, -5])).toEqual([[-6, 249], [999, 1254], [1999, 2254]]);
    expect(windowsOf(Array.from({ length: 9000 }, (_, label) => label))).toHaveLength(8);
  });

  it('are told exactly, whatever lies between and beyond them', () => {
    const map = named(-3, 7, 251, 252, 1000, 14_175);
    const samples = [0, -3, 7, 8, 251, 252, 1000, 999, 14_175, 60_000, -30_000];
    const numbers = new Uint16Array(samples.length);
    for (const window of map.windows) map.take(pictureOf(samples, window), window, numbers);
    expect([...numbers].map((number) => map.at(number)?.label ?? 0)).toEqual([0, -3, 7, 0, 251, 252, 1000, 0, 14_175, 0, 0]);
  });

  // The samples of a volume with labels of 64 bits have other numbers.
  it('are not told where labels have more bits than samples', () => {
    const map = new LabelMap([{ label: 3 }, { label: '720575940618780781' }]);
    expect(map.windows).toEqual([]);
    expect(map.at(2)?.label).toBe('720575940618780781');
  });

  it('have the colours of the surfaces that the daemon makes', () => {
    // As server/codec/encode_labels.cpp writes them.
    expect(seriesColour(0)).toBe('#e67373');
    expect(seriesColour(1)).toMatch(/^#[0-9a-f]{6}$/);
    expect(new Set(Array.from({ length: 50 }, (_, label) => seriesColour(label))).size).toBe(50);
    expect(new Set(['720575940618780781', '720575940618780782'].map(seriesColour)).size).toBe(2);
  });
});

describe('slices of labels', () => {
  it('have the colours of the file, and of the series where it has none', () => {
    const look = lookOf([{ label: 3, color: '#102030' }, { label: 7, color: null }]);
    expect([look.colourOf(3), look.colourOf(7)]).toEqual(['#102030', seriesColour(7)]);
    expect([...coloursOf(look).slice(4, 8)]).toEqual([0x10, 0x20, 0x30, 255]);
    expect(lookOf([{ label: 3 }], () => false).isShown(3)).toBe(false);
  });

  const look: LabelLook = { map: named(1, 2, 3), colourOf: (label) => ['', '#ff0000', '#00ff00', '#0000ff'][Number(label)] ?? '', isShown: (label) => label !== 3 };

  it('are painted in their colours: borders wholly, what is within with an opacity, what is hidden not at all', () => {
    const labels = Uint16Array.from([1, 1, 1, 0, 1, 1, 1, 2, 1, 1, 1, 3]);
    const pixels = paintLabels({ width: 4, height: 3, labels }, coloursOf(look), 0.4);
    const pixel = (x: number, y: number): number[] => [...pixels.subarray(4 * (4 * y + x), 4 * (4 * y + x) + 4)];
    expect(pixel(1, 1)).toEqual([255, 0, 0, 102]);
    expect(pixel(2, 1)).toEqual([255, 0, 0, 255]);
    expect(pixel(3, 1)).toEqual([0, 255, 0, 255]);
    expect(pixel(3, 0)[3]).toBe(0);
    expect(pixel(3, 2)[3]).toBe(0);
  });

  it('are met by a ray at the first label that is shown', () => {
    const samples = Uint8Array.from([0, 3, 0, 2, 1]);
    const preview = { dims: [5, 1, 1] as [number, number, number], samples };
    expect(firstLabel(preview, coloursOf(look), [-10, 0, 0], [1, 0, 0])).toEqual([3, 0, 0]);
    expect(firstLabel(preview, coloursOf(look), [-10, 3, 0], [1, 0, 0])).toBeNull();
  });
});
