import { describe, expect, it } from 'vitest';
import { blockSize, blocksOf, firstCrossing, inPreview, previewOf } from '@/volume/preview';
import type { Vec3 } from '@/api/types';

function file(dims: Vec3, samples: ArrayLike<number>, extra = ''): ArrayBuffer {
  const header =
    'NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\n' +
    `sizes: ${dims.join(' ')}\nspace directions: (2,0,0) (0,-1,0.5) (0,0,1e-1)\nspace origin: (-1.5,0,7)\n${extra}encoding: raw\n\n`;
  return Uint8Array.from([...new TextEncoder().encode(header), ...Array.from(samples)]).buffer;
}

// A ball around the middle of a cube: 1 inside, falling off.
function ball(size: number, radius: number): { dims: Vec3; samples: Uint8Array<ArrayBuffer> } {
  const samples = new Uint8Array(size ** 3);
  const middle = (size - 1) / 2;
  for (let i = 0; i < samples.length; i += 1) {
    const place = [i % size, Math.floor(i / size) % size, Math.floor(i / size ** 2)];
    const distance = Math.hypot(...place.map((value) => value - middle));
    samples[i] = Math.max(0, Math.min(255, 128 + 20 * (radius - distance)));
  }
  return { dims: [size, size, size], samples };
}

describe('a preview', () => {
  it('is read with its place', () => {
    const preview = previewOf(file([2, 1, 3], [10, 13, 10, 4, 5, 6]), [0, 51]);
    expect(preview.dims).toEqual([2, 1, 3]);
    expect(preview.origin).toEqual([-1.5, 0, 7]);
    expect(preview.steps).toEqual([
      [2, 0, 0],
      [0, -1, 0.5],
      [0, 0, 0.1],
    ]);
    // Also samples that look like the end of a header.
    expect([...preview.samples]).toEqual([10, 13, 10, 4, 5, 6]);
    expect(inPreview(preview, 10.2)).toBeCloseTo(0.2);
  });

  it('that is cut off, or is something else, is refused', () => {
    expect(() => previewOf(file([2, 1, 3], [1, 2, 3]), [0, 1])).toThrow(/ends/);
    expect(() => previewOf(Uint8Array.from([1, 2, 3]).buffer, [0, 1])).toThrow();
    expect(() => previewOf(file([2, 1, NaN], [1, 2]), [0, 1])).toThrow();
  });

  it('has blocks that hold the samples on their common sides', () => {
    const samples = new Uint8Array(20);
    samples[blockSize] = 9;
    samples[19] = 4;
    const { blocks, blockDims } = blocksOf(samples, [20, 1, 1]);
    expect(blockDims).toEqual([3, 1, 1]);
    expect([...blocks]).toEqual([0, 9, 0, 9, 0, 4]);
  });

  it('says where a ray meets the surface', () => {
    const { dims, samples } = ball(21, 6);
    const preview = { ...previewOf(file(dims, samples), [0, 255]) };
    const hit = firstCrossing(preview, 128 / 255, [-30, 10, 10], [1, 0, 0]);
    expect(hit?.[0]).toBeCloseTo(4, 0);
    expect(hit?.slice(1)).toEqual([10, 10]);
    const across = firstCrossing(preview, 128 / 255, [10, 60, -40], [0, -1, 1]);
    expect(Math.hypot(...(across ?? [0, 0, 0]).map((value) => value - 10))).toBeCloseTo(6, 0);
    expect(firstCrossing(preview, 128 / 255, [-30, 10, 1], [1, 0, 0])).toBeNull();
    expect(firstCrossing(preview, 128 / 255, [-30, 40, 10], [1, 0, 0])).toBeNull();
  });
});
