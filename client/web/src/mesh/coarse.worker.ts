// Makes coarse copies of a surface beside the page, from the coarse copies of its blocks.
import { levelsOf, merged, type Coarse } from './coarse';
import { buffersIn, type WorkerScope } from './transfer';

export interface CoarseRequest {
  // Of blocks that came since the last request; each belongs to the surface of that number.
  parts: { surface: number; coarse: Coarse }[];
  // The most triangles of each level, all surfaces together; they fall.
  most: readonly number[];
}

// For each level, the surfaces by their numbers.
export type CoarseAnswer = (readonly Coarse[])[];

const scope = self as unknown as WorkerScope<CoarseRequest, CoarseAnswer>;
const known: Coarse[][] = [];

scope.onmessage = ({ data: { parts, most } }) => {
  for (const { surface, coarse } of parts) (known[surface] ??= []).push(coarse);
  // Merged anew each time: what is handed over is not here any more.
  const levels = levelsOf(Array.from(known, (some) => merged(some ?? [])), most);
  scope.postMessage(levels, buffersIn(levels));
};
