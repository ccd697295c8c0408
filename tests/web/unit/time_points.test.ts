import { gzipSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';
import { readTimePoints, type Picture } from '@/volume/time_points';
import { seriesNifti, smallNrrd } from '../browser/files';

async function read(bytes: Buffer, chunk = bytes.length): Promise<Picture[]> {
  const found: Picture[] = [];
  const file = new Blob([new Uint8Array(bytes)]);
  // In pieces, as a disk gives them.
  const stream = (): ReadableStream<Uint8Array> =>
    new ReadableStream({
      start(controller) {
        for (let at = 0; at < bytes.length; at += chunk) controller.enqueue(new Uint8Array(bytes.subarray(at, at + chunk)));
        controller.close();
      },
    });
  await readTimePoints(Object.assign(file, { stream }), (index, picture) => (found[index] = picture), new AbortController().signal);
  return found;
}

// Three volumes of 4 x 3 samples, each twice as bright as the one before.
const first = [10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 12];
const three = seriesNifti(Buffer.from([...first, ...first.map((value) => 2 * value), ...first]), [4, 3, 1]);

describe('the volumes of a NIfTI file', () => {
  it('have a picture each, by one window, with the last row first', async () => {
    for (const [bytes, chunk] of [[three, 5], [three, 9999], [gzipSync(three), 7]] as const) {
      const found = await read(bytes, chunk);
      expect(found.map(({ width, height }) => [width, height])).toEqual([[4, 3], [4, 3], [4, 3]]);
      const [one, two, last] = found.map(({ grey }) => [...grey]);
      expect(one?.slice(0, 2)).toEqual([...(one ?? [])].slice(0, 2).sort((a, b) => a - b));
      expect(one?.at(8)).toBe(0);
      expect(two?.[1]).toBe(255);
      expect(last).toEqual(one);
    }
  });

  it('are shown as far as the file goes', async () => {
    expect(await read(three.subarray(0, 352 + 30), 8)).toHaveLength(2);
    for (let length = 0; length < 380; length += 7) expect((await read(three.subarray(0, length), 50)).length).toBeLessThan(3);
  });

  it('are not those of other files, and of a stream that is broken an error', async () => {
    expect(await read(smallNrrd())).toEqual([]);
    await expect(read(gzipSync(three).subarray(0, 60), 9)).rejects.toThrow();
  });

  it('are no longer read when nobody wants them', async () => {
    const wanted = new AbortController();
    const found: number[] = [];
    await readTimePoints(
      new Blob([new Uint8Array(three)]),
      (index) => {
        found.push(index);
        wanted.abort();
      },
      wanted.signal,
    );
    expect(found).toEqual([0]);
  });
});
