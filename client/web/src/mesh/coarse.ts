// Coarse copies of a surface for the time that it is turned: vertices of a cell of space become one.

export interface Coarse {
  positions: Float32Array<ArrayBuffer>;
  // Four numbers of 16 bits a vertex, as blocks have them.
  normals: Int16Array<ArrayBuffer>;
  index: Uint32Array<ArrayBuffer>;
  distances?: Float32Array<ArrayBuffer>;
}

type Named = Pick<Coarse, 'positions' | 'normals'> & { index: ArrayLike<number> };

export function meanEdge({ positions, index }: Pick<Coarse, 'positions' | 'index'>): number {
  const step = Math.max(1, Math.floor(index.length / 3 / 500));
  let sum = 0;
  let count = 0;
  for (let triangle = 0; 3 * triangle + 1 < index.length; triangle += step) {
    const a = 3 * (index[3 * triangle] as number);
    const b = 3 * (index[3 * triangle + 1] as number);
    sum += Math.hypot(
      (positions[a] as number) - (positions[b] as number),
      (positions[a + 1] as number) - (positions[b + 1] as number),
      (positions[a + 2] as number) - (positions[b + 2] as number),
    );
    count += 1;
  }
  return count > 0 ? sum / count : 0;
}

// The vertex that stands for each on the border: the least one of its cell, which is the same in the neighbouring block, so that
// no gap opens between the two.
function joinBorder(positions: Float32Array, border: Uint16Array, cellOf: (at: number) => number, heads: Uint32Array): void {
  const isBefore = (a: number, b: number): boolean => {
    for (let axis = 0; axis < 3; axis += 1) {
      const difference = (positions[3 * a + axis] as number) - (positions[3 * b + axis] as number);
      if (difference !== 0) return difference < 0;
    }
    return false;
  };
  const least = new Map<number, number>();
  for (const vertex of border) {
    const key = cellOf(3 * vertex);
    const head = least.get(key);
    if (head === undefined || isBefore(vertex, head)) least.set(key, vertex);
  }
  for (const vertex of border) heads[vertex] = least.get(cellOf(3 * vertex)) ?? vertex;
}

export interface Cells {
  size: number;
  // The vertices of a cell become one for each octant that their normals point into, so that both sides of a thin wall stay.
  areByOctant: boolean;
}

// The triangles that are left when the vertices of a cell become one. Vertices on the border become one of these.
//
// meshoptimizer's simplifySloppy takes 1.4 to 1.8 times as long for as many triangles (5.1 million made
// coarse: 272 against 154 ms) and joins vertices of both sides of a thin wall.
export function clustered({ positions, normals, index }: Named, border: Uint16Array, { size: cell, areByOctant }: Cells): Uint32Array<ArrayBuffer> {
  if (!(cell > 0)) return Uint32Array.from(index);
  const first = new Map<number, number>();
  const heads = new Uint32Array(positions.length / 3);
  // 15 bits an axis: cells whose numbers are the same by overflow are farther apart than a block is wide.
  const place = (at: number): number => Math.floor((positions[at] as number) / cell) & 0x7fff;
  const cellOf = (at: number): number => (place(at) * 0x8000 + place(at + 1)) * 0x8000 + place(at + 2);
  const side = (at: number): number => (areByOctant && (normals[at] as number) < 0 ? 1 : 0);
  for (let vertex = 0; vertex < heads.length; vertex += 1) {
    const octant = 4 * side(4 * vertex) + 2 * side(4 * vertex + 1) + side(4 * vertex + 2);
    const key = cellOf(3 * vertex) * 8 + octant;
    const head = first.get(key);
    if (head === undefined) first.set(key, vertex);
    heads[vertex] = head ?? vertex;
  }
  joinBorder(positions, border, cellOf, heads);
  const kept = new Uint32Array(index.length);
  // Many become the same one.
  const known = new Set<number>();
  let used = 0;
  // The head of one inside may be on the border, and that one's head another.
  const headAt = (corner: number): number => heads[heads[index[corner] as number] as number] as number;
  for (let i = 0; i + 2 < index.length; i += 3) {
    const a = headAt(i);
    const b = headAt(i + 1);
    const c = headAt(i + 2);
    if (a === b || b === c || a === c) continue;
    // What was turned over by that would be dark or, of a label, not be drawn at all.
    const isOver = isTurned(positions, normals, a, b, c);
    const corners = [a, isOver ? c : b, isOver ? b : c] as const;
    const key = keyOf(corners, heads.length);
    if (known.has(key)) continue;
    known.add(key);
    kept.set(corners, used);
    used += 3;
  }
  return kept.slice(0, used);
}

// The same for the same triangle from any of its corners on. Exact below 200 000 vertices; beyond that a few triangles may be taken
// for others.
function keyOf([a, b, c]: readonly [number, number, number], vertices: number): number {
  if (a < b && a < c) return (a * vertices + b) * vertices + c;
  if (b < c) return (b * vertices + c) * vertices + a;
  return (c * vertices + a) * vertices + b;
}

// Whether the triangle faces away from where the normals of its vertices point.
function isTurned(positions: Float32Array, normals: Int16Array, a: number, b: number, c: number): boolean {
  const at = (vertex: number, axis: number): number => positions[3 * vertex + axis] as number;
  const normal = (axis: number): number =>
    (normals[4 * a + axis] as number) + (normals[4 * b + axis] as number) + (normals[4 * c + axis] as number);
  const side = (axis: number): number => {
    const [second, third] = [(axis + 1) % 3, (axis + 2) % 3];
    return (
      (at(b, second) - at(a, second)) * (at(c, third) - at(a, third)) -
      (at(b, third) - at(a, third)) * (at(c, second) - at(a, second))
    );
  };
  return side(0) * normal(0) + side(1) * normal(1) + side(2) * normal(2) < 0;
}

// These triangles with the vertices that they name.
export function compacted({ positions, normals, distances }: Omit<Coarse, 'index'>, triangles: Uint32Array): Coarse {
  const numbers = new Int32Array(positions.length / 3).fill(-1);
  const vertices: number[] = [];
  const index = triangles.map((vertex) => {
    if (numbers[vertex] === -1) numbers[vertex] = vertices.push(vertex) - 1;
    return numbers[vertex] as number;
  });
  const made: Coarse = { positions: new Float32Array(3 * vertices.length), normals: new Int16Array(4 * vertices.length), index: Uint32Array.from(index) };
  vertices.forEach((vertex, number) => {
    made.positions.set(positions.subarray(3 * vertex, 3 * vertex + 3), 3 * number);
    made.normals.set(normals.subarray(4 * vertex, 4 * vertex + 4), 4 * number);
  });
  if (distances) made.distances = Float32Array.from(vertices, (vertex) => distances[vertex] as number);
  return made;
}

// All of them as one.
export function merged(parts: readonly Coarse[]): Coarse {
  const sum = (count: (part: Coarse) => number): number => parts.reduce((before, part) => before + count(part), 0);
  const vertices = sum(({ positions }) => positions.length / 3);
  const made: Coarse = {
    positions: new Float32Array(3 * vertices),
    normals: new Int16Array(4 * vertices),
    index: new Uint32Array(sum(({ index }) => index.length)),
  };
  if (parts.some(({ distances }) => distances)) made.distances = new Float32Array(vertices);
  let vertex = 0;
  let corner = 0;
  for (const { positions, normals, index, distances } of parts) {
    made.positions.set(positions, 3 * vertex);
    made.normals.set(normals, 4 * vertex);
    if (distances) made.distances?.set(distances, vertex);
    for (const named of index) made.index[corner++] = vertex + named;
    vertex += positions.length / 3;
  }
  return made;
}

const noBorder = new Uint16Array(0);
const leastGrowth = 1.1;
const leastCell = 1e-3;
const enough = 0.9;

function trianglesOf(surfaces: readonly Coarse[]): number {
  return surfaces.reduce((sum, { index }) => sum + index.length / 3, 0);
}

// The surfaces with at most so many triangles together, by cells of one size.
function within(surfaces: readonly Coarse[], most: number): readonly Coarse[] {
  let made = surfaces;
  let count = trianglesOf(surfaces);
  const edge = Math.max(leastCell, ...surfaces.map(meanEdge));
  const cells: Cells = { size: edge, areByOctant: true };
  while (count > most) {
    cells.size *= Math.max(leastGrowth, Math.sqrt(count / most));
    made = surfaces.map((surface) => compacted(surface, clustered(surface, noBorder, cells)));
    const before = count;
    count = trianglesOf(made);
    // What a cell holds of a rough surface points into all octants, so that larger cells alone leave no fewer triangles.
    if (cells.areByOctant && count > enough * before) Object.assign(cells, { size: edge, areByOctant: false });
  }
  return made;
}

// The same surfaces with at most each of these numbers of triangles, which fall.
export function levelsOf(surfaces: readonly Coarse[], most: readonly number[]): (readonly Coarse[])[] {
  let finer = surfaces;
  return most.map((count) => (finer = within(finer, count)));
}
