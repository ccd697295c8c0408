// Coarse copies of a surface for the time that it is turned. A library collapses edges, so that a copy has the surface's shape and no
// holes of its own. Its vertices are some of the surface's.
import { MeshoptSimplifier } from 'meshoptimizer/simplifier';
import { packedNormals, triangleNormals, vertexSums } from './blocks';

export interface Coarse {
  positions: Float32Array<ArrayBuffer>;
  // Four numbers of 16 bits a vertex, as blocks have them.
  normals: Int16Array<ArrayBuffer>;
  index: Uint32Array<ArrayBuffer>;
  distances?: Float32Array<ArrayBuffer>;
}

export const isReady: Promise<void> = MeshoptSimplifier.ready;

// These triangles with the vertices that they name.
function compacted({ positions, normals, distances }: Omit<Coarse, 'index'>, triangles: Uint32Array): Coarse {
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

// The surface with about that part of its triangles; with more if fewer would change its topology. A border that is kept fits to the
// neighbouring block's.
export function simplified(surface: Coarse, part: number, keepsBorder: boolean): Coarse {
  const corners = 3 * Math.ceil((surface.index.length / 3) * Math.min(1, part));
  if (corners === surface.index.length) return surface;
  const [index] = MeshoptSimplifier.simplify(surface.index, surface.positions, 3, corners, 1, keepsBorder ? ['LockBorder'] : []);
  return compacted(surface, index);
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

// With the normals of its own triangles: those of a surface with more of them are wrong for it. Vertices at one place have the same,
// so that no seam is seen.
function shaded(surface: Coarse): Coarse {
  const { positions, index } = surface;
  const first = MeshoptSimplifier.generatePositionRemap(positions, 3);
  const sums = vertexSums({ positions, index: index.map((vertex) => first[vertex] as number) }, triangleNormals(surface));
  first.forEach((one, vertex) => sums.copyWithin(3 * vertex, 3 * one, 3 * one + 3));
  return { ...surface, normals: packedNormals(sums) };
}

// The same surfaces with about these numbers of triangles, which fall.
export function levelsOf(surfaces: readonly Coarse[], most: readonly number[]): (readonly Coarse[])[] {
  let finer = surfaces;
  return most.map((count) => {
    const triangles = finer.reduce((sum, { index }) => sum + index.length / 3, 0);
    finer = finer.map((surface) => simplified(surface, count / Math.max(1, triangles), false));
    return finer.map(shaded);
  });
}
