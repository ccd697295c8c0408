// Edges that are shaded as edges: where the outside of a label meets its wall to a neighbour, the mean of both normals is right for
// neither side.
import type { Triangles } from './blocks';

// Triangles that share an edge at a larger angle are not shaded as one.
const smoothest = Math.cos((50 * Math.PI) / 180);
// Around most vertices no triangle is turned so far from the mean, and nothing has to be looked for.
const near = Math.cos((25 * Math.PI) / 180);

// The same with length 1, or 0 where a triangle has no area.
function unit(normals: Float32Array): Float32Array {
  const units = normals.slice();
  for (let i = 0; i < units.length; i += 3) {
    const length = Math.hypot(units[i] as number, units[i + 1] as number, units[i + 2] as number);
    for (let axis = 0; axis < 3 && length > 0; axis += 1) units[i + axis] = (units[i + axis] as number) / length;
  }
  return units;
}

// The corners of each vertex, one after the other, and where those of a vertex begin.
function cornersOf(index: Uint32Array, vertices: number): { corners: Uint32Array; begin: Uint32Array } {
  const begin = new Uint32Array(vertices + 1);
  for (const vertex of index) begin[vertex + 1] = (begin[vertex + 1] as number) + 1;
  for (let vertex = 0; vertex < vertices; vertex += 1) begin[vertex + 1] = (begin[vertex + 1] as number) + (begin[vertex] as number);
  const next = begin.slice();
  const corners = new Uint32Array(index.length);
  index.forEach((vertex, corner) => {
    corners[next[vertex] as number] = corner;
    next[vertex] = (next[vertex] as number) + 1;
  });
  return { corners, begin };
}

const faceOf = (corner: number): number => corner - (corner % 3);

function dot(a: ArrayLike<number>, i: number, b: ArrayLike<number>, j: number): number {
  return (a[i] as number) * (b[j] as number) + (a[i + 1] as number) * (b[j + 1] as number) + (a[i + 2] as number) * (b[j + 2] as number);
}

function isFlat(normals: Float32Array, around: Uint32Array): boolean {
  const mean = new Float32Array(3);
  for (const corner of around) {
    for (let axis = 0; axis < 3; axis += 1) mean[axis] = (mean[axis] as number) + (normals[faceOf(corner) + axis] as number);
  }
  const least = near * Math.hypot(...mean);
  return around.every((corner) => dot(normals, faceOf(corner), mean, 0) >= least);
}

// The triangles, whose normals are given, with a vertex of its own for each of their smooth sides. Vertices that are `fixed` stay one;
// no more are added than make `most`.
export function splitCreases(triangles: Triangles, ofTriangles: Float32Array, fixed: Uint16Array, most: number): Triangles {
  const { positions, distances } = triangles;
  const vertices = positions.length / 3;
  const normals = unit(ofTriangles);
  const { corners, begin } = cornersOf(triangles.index, vertices);
  const isFixed = new Uint8Array(vertices);
  for (const vertex of fixed) isFixed[vertex] = 1;
  const index = triangles.index.slice();
  const copied: number[] = [];

  // True if the triangles share an edge at the vertex of these corners.
  const areBeside = (a: number, b: number): boolean => {
    const other = (corner: number, step: number): number => triangles.index[faceOf(corner) + ((corner + step) % 3)] as number;
    return other(a, 1) === other(b, 2) || other(a, 2) === other(b, 1);
  };

  for (let vertex = 0; vertex < vertices; vertex += 1) {
    const around = corners.subarray(begin[vertex], begin[vertex + 1]);
    if (isFixed[vertex] === 1 || around.length < 2 || isFlat(normals, around)) continue;
    // Side by side, from each triangle to those that go on smoothly.
    const left = new Set(around);
    for (let side = 0; left.size > 0; side += 1) {
      const [first = 0] = left;
      const reached = [first];
      left.delete(first);
      for (const corner of reached) {
        for (const candidate of left) {
          if (!areBeside(corner, candidate) || dot(normals, faceOf(corner), normals, faceOf(candidate)) < smoothest) continue;
          left.delete(candidate);
          reached.push(candidate);
        }
      }
      if (side === 0) continue;
      if (vertices + copied.length >= most) break;
      for (const corner of reached) index[corner] = vertices + copied.length;
      copied.push(vertex);
    }
  }

  if (copied.length === 0) return triangles;
  const all = new Float32Array(positions.length + 3 * copied.length);
  all.set(positions);
  copied.forEach((vertex, at) => all.set(positions.subarray(3 * vertex, 3 * vertex + 3), positions.length + 3 * at));
  const split: Triangles = { positions: all, index };
  if (distances) split.distances = Float32Array.from([...distances, ...copied.map((vertex) => distances[vertex] as number)]);
  return split;
}
