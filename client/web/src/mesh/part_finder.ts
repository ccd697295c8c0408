// The parts of a surface that do not touch each other, found in its blocks some at a time.
import type { Vec3 } from '../api/types';
import { placeKey, type Block } from './blocks';

export interface PartSummary {
  number: number;
  triangles: number;
  area: number; // mm2
  volume: number; // mm3, of a closed part
  // A vertex of it.
  point: Vec3;
  // The corners of the box around it.
  low: Vec3;
  high: Vec3;
}

// The numbers of these parts among those of the same surface that was found anew: blocks come in any order, and parts are numbered as
// they come. Each is the one whose box is most like its own.
export function foundAnew(parts: readonly PartSummary[], all: readonly PartSummary[]): number[] {
  const unlike = (a: PartSummary, b: PartSummary): number =>
    [...a.low, ...a.high].reduce((sum, value, at) => sum + Math.abs(value - ([...b.low, ...b.high][at] as number)), 0);
  return parts.flatMap((part) => {
    let [nearest, least] = [all[0], Infinity];
    for (const one of all) {
      const difference = unlike(part, one);
      if (difference < least) [nearest, least] = [one, difference];
    }
    return nearest ? [nearest.number] : [];
  });
}

type Drawn = Pick<Block, 'positions' | 'index' | 'border'>;

export class PartFinder {
  // The vertices of all blocks, one block's behind the other's; of each another one of its part, or itself.
  private readonly parents: Uint32Array;
  private readonly firsts: number[] = [];
  private readonly places = new Map<string, number>();
  private readonly parts = new Map<number, PartSummary>();
  private done = 0;

  constructor(private readonly blocks: readonly Drawn[]) {
    let count = 0;
    for (const { positions } of blocks) {
      this.firsts.push(count);
      count += positions.length / 3;
    }
    this.parents = new Uint32Array(count).map((_, vertex) => vertex);
  }

  // One block in one way; false when all is found.
  step(): boolean {
    const { blocks, done } = this;
    const way = Math.floor(done / Math.max(1, blocks.length));
    const at = done % Math.max(1, blocks.length);
    const block = blocks[at];
    if (!block || way > 2) return false;
    const first = this.firsts[at] as number;
    if (way === 0) this.joinTriangles(block, first);
    else if (way === 1) this.joinBorder(block, first);
    else this.sum(block, first);
    this.done += 1;
    return true;
  }

  get all(): readonly PartSummary[] {
    return [...this.parts.values()];
  }

  // The part that has the block's vertex.
  partOf(block: number, vertex: number): PartSummary | null {
    const first = this.firsts[block];
    return first === undefined ? null : (this.parts.get(this.rootOf(first + vertex)) ?? null);
  }

  // The triangles of that block which belong to parts that are wanted, by their numbers.
  indexOf(block: number, isWanted: (part: number) => boolean): Uint16Array<ArrayBuffer> {
    const { index } = this.blocks[block] ?? { index: new Uint16Array() };
    const kept = new Uint16Array(index.length);
    let used = 0;
    for (let i = 0; i + 2 < index.length; i += 3) {
      if (!isWanted(this.partOf(block, index[i] as number)?.number ?? -1)) continue;
      kept.set(index.subarray(i, i + 3), used);
      used += 3;
    }
    return kept.slice(0, used);
  }

  private rootOf(vertex: number): number {
    const { parents } = this;
    let at = vertex;
    while (parents[at] !== at) {
      parents[at] = parents[parents[at] as number] as number;
      at = parents[at] as number;
    }
    return at;
  }

  private join(one: number, other: number): void {
    const [a, b] = [this.rootOf(one), this.rootOf(other)];
    if (a !== b) this.parents[Math.max(a, b)] = Math.min(a, b);
  }

  private joinTriangles({ index }: Drawn, first: number): void {
    for (let i = 0; i + 2 < index.length; i += 3) {
      this.join(first + (index[i] as number), first + (index[i + 1] as number));
      this.join(first + (index[i] as number), first + (index[i + 2] as number));
    }
  }

  private joinBorder({ border, positions }: Drawn, first: number): void {
    for (const vertex of border) {
      const key = placeKey(positions, vertex);
      const known = this.places.get(key);
      if (known === undefined) this.places.set(key, first + vertex);
      else this.join(known, first + vertex);
    }
  }

  private sum({ index, positions }: Drawn, first: number): void {
    const at = (vertex: number, axis: number): number => positions[3 * vertex + axis] as number;
    for (let i = 0; i + 2 < index.length; i += 3) {
      const [a, b, c] = [index[i] as number, index[i + 1] as number, index[i + 2] as number];
      const part = this.partFor(this.rootOf(first + a), [at(a, 0), at(a, 1), at(a, 2)]);
      // From one of its vertices, so that large coordinates take no digits.
      const [ox, oy, oz] = part.point;
      const [ux, uy, uz] = [at(b, 0) - at(a, 0), at(b, 1) - at(a, 1), at(b, 2) - at(a, 2)];
      const [vx, vy, vz] = [at(c, 0) - at(a, 0), at(c, 1) - at(a, 1), at(c, 2) - at(a, 2)];
      const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      part.triangles += 1;
      part.area += Math.hypot(nx, ny, nz) / 2;
      part.volume += ((at(a, 0) - ox) * nx + (at(a, 1) - oy) * ny + (at(a, 2) - oz) * nz) / 6;
      for (const vertex of [a, b, c]) {
        for (const axis of [0, 1, 2] as const) {
          const value = at(vertex, axis);
          if (value < part.low[axis]) part.low[axis] = value;
          if (value > part.high[axis]) part.high[axis] = value;
        }
      }
    }
  }

  private partFor(root: number, point: Vec3): PartSummary {
    const known = this.parts.get(root);
    if (known) return known;
    const made: PartSummary = { number: this.parts.size, triangles: 0, area: 0, volume: 0, point, low: [...point], high: [...point] };
    this.parts.set(root, made);
    return made;
  }
}
