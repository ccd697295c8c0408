// The scale bar of a picture.
import { expect, test } from 'vitest';
import { captionScale, roundLength } from '@/scene/picture';

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

test('captions are as large as on the page, or larger in a picture that is shown small on a sheet', () => {
  expect(captionScale({ width: 780, height: 800 }, 400)).toBe(2);
  expect(captionScale({ width: 1800, height: 1200 }, 600)).toBe(4);
  // Flat, of which they would hide most.
  expect(captionScale({ width: 4000, height: 900 }, 450)).toBe(4);
});
