// Makes coarse copies of a surface beside the page, from its blocks.
import { isReady, levelsOf, merged, simplified, type Coarse } from './coarse';
import { buffersIn, type WorkerScope } from './transfer';

// A block of the surface of that number; or the wish for copies of all blocks that came, with about so many triangles.
export type CoarseRequest = { surface: number; block: Omit<Coarse, 'index'> & { index: Uint16Array | Uint32Array } } | { most: readonly number[] };

// For each level, the surfaces by their numbers. Null: a block was taken.
export type CoarseAnswer = (readonly Coarse[])[] | null;

// The part of its triangles that a block is kept with.
const kept = 1 / 8;

const scope = self as unknown as WorkerScope<CoarseRequest, CoarseAnswer>;
const known: Coarse[][] = [];

function answerTo(request: CoarseRequest): CoarseAnswer {
  if ('most' in request) return levelsOf(Array.from(known, (some) => merged(some ?? [])), request.most);
  const { surface, block } = request;
  (known[surface] ??= []).push(simplified({ ...block, index: Uint32Array.from(block.index) }, kept, true));
  return null;
}

scope.onmessage = ({ data }) => {
  void isReady.then(() => {
    const answer = answerTo(data);
    scope.postMessage(answer, buffersIn(answer));
  });
};
