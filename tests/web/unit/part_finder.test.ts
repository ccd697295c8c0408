import { describe, expect, it } from 'vitest';
import { prepare, type Block } from '@/mesh/blocks';
import { foundAnew, PartFinder } from '@/mesh/part_finder';

// The sides of a cube of that edge, which begins there; some of its triangles.
function cube(edge: number, begin: number, triangles = [...Array(12).keys()]): Block {
  const positions = Float32Array.from({ length: 24 }, (_, i) => begin + edge * ((Math.floor(i / 3) >> (i % 3)) & 1));
  const sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  const all = sides.flatMap(([a = 0, b = 0, c = 0, d = 0]) => [[a, b, c], [a, c, d]]);
  return prepare({ positions, index: Uint32Array.from(triangles.flatMap((triangle) => all[triangle] ?? [])) });
}

function found(...blocks: Block[]): PartFinder {
  const finder = new PartFinder(blocks);
  while (finder.step());
  return finder;
}

describe('the parts of a surface', () => {
  it('are told apart within a block, with their sizes', () => {
    const [small, large] = [cube(1, 0), cube(2, 100)];
    const both = prepare({
      positions: Float32Array.from([...small.positions, ...large.positions]),
      index: Uint32Array.from([...small.index, ...large.index.map((vertex) => vertex + 8)]),
    });
    const finder = found(both);
    expect(finder.all).toHaveLength(2);
    expect(finder.partOf(0, 0)).toMatchObject({ triangles: 12, area: 6, point: [0, 0, 0] });
    expect(finder.partOf(0, 8)).toMatchObject({ triangles: 12, area: 24, point: [100, 100, 100] });
    expect([0, 8].map((vertex) => Math.round(1e6 * (finder.partOf(0, vertex)?.volume ?? 0)))).toEqual([1e6, 8e6]);
    expect(finder.partOf(1, 0)).toBeNull();
    const index = finder.indexOf(0, (number) => number === finder.partOf(0, 8)?.number);
    expect([index.length, Math.min(...index)]).toEqual([36, 8]);
    expect(finder.indexOf(0, () => true)).toEqual(both.index);
  });

  it('are found again in a surface whose blocks came in another order', () => {
    const [small, large, other] = [cube(1, 0), cube(2, 100), cube(1, 50)];
    const [first, second] = [found(small, large, other), found(other, small, large)];
    const numbers = foundAnew(first.all, second.all);
    expect(numbers).toEqual([small, large, other].map((block) => second.partOf([other, small, large].indexOf(block), 0)?.number));
    expect(numbers).not.toEqual(first.all.map(({ number }) => number));
    expect(first.partOf(1, 0)).toMatchObject({ low: [100, 100, 100], high: [102, 102, 102] });
    expect(foundAnew(first.all, [])).toEqual([]);
  });

  it('go on across the seams of blocks', () => {
    const finder = found(cube(1, 0, [0, 1, 2, 3, 4]), cube(1, 5), cube(1, 0, [5, 6, 7, 8, 9, 10, 11]));
    expect(finder.all).toHaveLength(2);
    expect(finder.partOf(0, 0)).toBe(finder.partOf(2, 3));
    expect(finder.partOf(2, 0)?.area).toBeCloseTo(6);
    expect(finder.partOf(2, 0)?.volume).toBeCloseTo(1);
  });
});
