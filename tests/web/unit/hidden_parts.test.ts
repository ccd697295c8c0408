import { expect, it } from 'vitest';
import { HiddenParts } from '@/mesh/hidden_parts';
import type { PartSummary } from '@/mesh/part_finder';
import type { Vec3 } from '@/api/types';

function part(number: number, begin: number, area: number): PartSummary {
  const [low, high]: [Vec3, Vec3] = [[begin, 0, 0], [begin + 1, 1, 1]];
  return { number, triangles: 12, area, volume: 1, point: low, low, high };
}

// The same three parts, as they are numbered in two orders.
const before = [part(0, 0, 6), part(1, 10, 9), part(2, 20, 3)];
const after = [part(0, 20, 3), part(1, 0, 6), part(2, 10, 9)];

// The beginnings of the shown ones.
const shownOf = (parts: HiddenParts): number[] => parts.shown.map(({ low }) => low[0]);

function hidingTheFirst(): HiddenParts {
  const parts = new HiddenParts();
  parts.take(before);
  parts.show(({ number }) => number !== 0);
  return parts;
}

it('lists the largest first, and shows all of a surface', () => {
  const parts = new HiddenParts();
  expect(parts.areFound).toBe(false);
  parts.take(before);
  expect(parts.areFound).toBe(true);
  expect(parts.all.map(({ area }) => area)).toEqual([9, 6, 3]);
  expect(shownOf(parts)).toEqual([10, 0, 20]);
});

it('stay hidden when the surface comes with other numbers', () => {
  const parts = hidingTheFirst();
  parts.lose();
  expect(parts.areFound).toBe(false);
  parts.take(after);
  expect(shownOf(parts)).toEqual([10, 20]);
  expect([...parts.numbers]).toEqual([1]);
});

it('are those that a person chose last, also while the parts of the next surface are looked for', () => {
  const parts = hidingTheFirst();
  parts.lose();
  parts.show(() => true);
  parts.take(after);
  expect(shownOf(parts)).toEqual([10, 0, 20]);
  parts.lose();
  parts.show(({ low }) => low[0] === 20);
  parts.take(before);
  expect(shownOf(parts)).toEqual([20]);
});
