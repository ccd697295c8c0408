import { afterEach, describe, expect, it, vi } from 'vitest';
import type { Volume } from '@/api/types';
import { client } from '@/client';
import { Scope } from '@/ui/signal';
import { ExactSamples } from '@/volume/exact';

const volume = { id: 'a', dims: [2, 2, 3], type: 'uint8' } as unknown as Volume;

describe('the exact value at a place', () => {
  afterEach(() => vi.restoreAllMocks());

  it('is that of the last place that was asked for, whichever answer comes first', async () => {
    const answers: (() => void)[] = [];
    vi.spyOn(client, 'samplesOfSlice').mockImplementation(
      (_id, _axis, index) => new Promise((resolve) => answers.push(() => resolve(Uint8Array.of(index, 0, 0, 50 + index).buffer))),
    );
    const exact = new ExactSamples(volume, new Scope());
    const first = exact.read('z', [0, 0, 1]);
    const second = exact.read('z', [1, 1, 2]);
    for (const answer of answers.reverse()) answer();
    expect(await Promise.all([first, second])).toEqual([null, 52]);
    // Both slices are here now.
    expect(await exact.read('z', [0, 0, 1])).toBe(1);
  });
});
