// The scale bar of a picture.
import { expect, test } from 'vitest';
import { roundLength } from '@/scene/picture';

test.each([
  [0.0302, 0.02],
  [0.99, 0.5],
  [1, 1],
  [1.99, 1],
  [4.9, 2],
  [50, 50],
  [99, 50],
  [183, 100],
])('at most %d mm are %d mm', (most, length) => {
  expect(roundLength(most)).toBeCloseTo(length, 12);
});
