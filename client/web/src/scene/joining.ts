// Joins the shading of blocks across their seams, some milliseconds at a time.
import type { Parts } from './parts';

const mostMilliseconds = 6;

export function joinSeams(parts: Pick<Parts, 'joinSeams'>, signal: AbortSignal, then: () => void, step = 0): void {
  if (signal.aborted) return;
  const until = performance.now() + mostMilliseconds;
  let next = step;
  while (performance.now() < until) {
    if (!parts.joinSeams(next)) {
      then();
      return;
    }
    next += 1;
  }
  requestAnimationFrame(() => joinSeams(parts, signal, then, next));
}
