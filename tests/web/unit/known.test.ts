import { afterEach, describe, expect, it, vi, type MockInstance } from 'vitest';
import { ApiError, unreachable } from '@/api/problem';
import type { Volume } from '@/api/types';
import { client } from '@/client';
import { KnownVolumes } from '@/volume/known';

const volume = { id: 'a', name: 'knee' } as Volume;

function answers(...all: (Volume | Error)[]): MockInstance<typeof client.getVolume> {
  const spy = vi.spyOn(client, 'getVolume');
  for (const one of all) spy.mockImplementationOnce(() => (one instanceof Error ? Promise.reject(one) : Promise.resolve(one)));
  return spy;
}

describe('the volumes of jobs', () => {
  afterEach(() => vi.restoreAllMocks());

  it('are asked for once, also those that are missing, which hide no other', async () => {
    const asked = answers(new ApiError(404, 'Not found', ''), new ApiError(500, 'Internal error', ''), new ApiError(422, 'Damaged', ''), volume);
    const known = new KnownVolumes();
    await known.find(['gone', 'bad', 'broken', 'a']);
    await known.find(['a', 'bad', 'gone']);
    expect(asked).toHaveBeenCalledTimes(4);
    expect(['a', 'gone', 'bad', 'broken', 'other'].map((id) => known.nameOf(id))).toEqual(['knee', 'erased volume', 'unreadable volume', 'unreadable volume', '']);
    expect([known.get('a'), known.get('bad'), known.get('gone'), known.detailed(volume).dicom]).toEqual([volume, null, null, undefined]);
  });

  it('are asked for again if the request failed', async () => {
    answers(unreachable(), new ApiError(503, 'Busy', ''), new ApiError(401, 'No token', ''), volume);
    const known = new KnownVolumes();
    for (const status of [0, 503, 401]) await expect(known.find(['a'])).rejects.toMatchObject({ status });
    expect(known.nameOf('a')).toBe('');
    await known.find(['a']);
    expect(known.nameOf('a')).toBe('knee');
  });
});
