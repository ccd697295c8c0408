// Arrays of triangles made ready for drawing: blocks of 16-bit indices, normals and borders.
import type { Vec3 } from '../api/types';
import { splitCreases } from './creases';

export interface Triangles {
  positions: Float32Array<ArrayBuffer>;
  index: Uint32Array<ArrayBuffer>;
  // Of each vertex, in millimetres; where the file has them.
  distances?: Float32Array<ArrayBuffer>;
}

// A block as it is drawn. Transferable.
export interface Block {
  positions: Float32Array<ArrayBuffer>;
  index: Uint16Array<ArrayBuffer>;
  // Four numbers of 16 bits a vertex, normalised; the fourth is there to align the vertices to 4 bytes.
  normals: Int16Array<ArrayBuffer>;
  // Vertices on edges of one triangle, where the neighbouring block goes on, and their normals before
  // normalisation.
  border: Uint16Array<ArrayBuffer>;
  borderNormals: Float32Array<ArrayBuffer>;
  distances?: Float32Array<ArrayBuffer>;
  // The corners of the box around it.
  bounds: readonly [Vec3, Vec3];
}

const mostVertices = 65_535;
export const mostTriangles = 65_000;

interface Named {
  positions: Float32Array;
  index: ArrayLike<number>;
}

// The triangles' normals times twice their area, three numbers each.
export function triangleNormals({ positions, index }: Named): Float32Array<ArrayBuffer> {
  const normals = new Float32Array(index.length);
  for (let i = 0; i + 2 < index.length; i += 3) {
    const a = 3 * (index[i] as number);
    const b = 3 * (index[i + 1] as number);
    const c = 3 * (index[i + 2] as number);
    const ax = positions[a] as number;
    const ay = positions[a + 1] as number;
    const az = positions[a + 2] as number;
    const ux = (positions[b] as number) - ax;
    const uy = (positions[b + 1] as number) - ay;
    const uz = (positions[b + 2] as number) - az;
    const vx = (positions[c] as number) - ax;
    const vy = (positions[c + 1] as number) - ay;
    const vz = (positions[c + 2] as number) - az;
    normals[i] = uy * vz - uz * vy;
    normals[i + 1] = uz * vx - ux * vz;
    normals[i + 2] = ux * vy - uy * vx;
  }
  return normals;
}

// Their sums at each vertex, three numbers each.
export function vertexSums({ positions, index }: Named, normals: Float32Array): Float32Array<ArrayBuffer> {
  const sums = new Float32Array(positions.length);
  for (let corner = 0; corner < index.length; corner += 1) {
    const vertex = 3 * (index[corner] as number);
    const triangle = corner - (corner % 3);
    for (let axis = 0; axis < 3; axis += 1) sums[vertex + axis] = (sums[vertex + axis] as number) + (normals[triangle + axis] as number);
  }
  return sums;
}

// Writes one normal; a sum of zero gives one that points up.
export function packNormal(normals: Int16Array, vertex: number, x: number, y: number, z: number): void {
  const length = Math.hypot(x, y, z);
  const scale = length > 0 ? 32_767 / length : 0;
  normals[4 * vertex] = Math.round(x * scale);
  normals[4 * vertex + 1] = Math.round(y * scale);
  normals[4 * vertex + 2] = length > 0 ? Math.round(z * scale) : 32_767;
}

export function packedNormals(sums: Float32Array): Int16Array<ArrayBuffer> {
  const normals = new Int16Array((sums.length / 3) * 4);
  for (let vertex = 0; 3 * vertex < sums.length; vertex += 1) {
    const at = 3 * vertex;
    packNormal(normals, vertex, sums[at] as number, sums[at + 1] as number, sums[at + 2] as number);
  }
  return normals;
}

// All blocks of a surface share one grid, so that a vertex on a seam has the same bits in every block that names it.
export function placeKey(positions: Float32Array, vertex: number): string {
  return String.fromCharCode(...new Uint16Array(positions.buffer, positions.byteOffset + 12 * vertex, 6));
}

// The vertices of edges whose other direction no triangle has. At most 65 535 vertices.
export function borderVertices(index: ArrayLike<number>, vertices: number): Uint16Array<ArrayBuffer> {
  let slots = 1024;
  while (slots < index.length * 2) slots *= 2;
  const mask = slots - 1;
  const table = new Uint32Array(slots).fill(0xffff_ffff);
  const slotOf = (key: number): number => {
    let slot = (Math.imul(key, 0x9e37_79b1) >>> 7) & mask;
    while (table[slot] !== 0xffff_ffff && table[slot] !== key) slot = (slot + 1) & mask;
    return slot;
  };
  const next = (i: number): number => (i % 3 === 2 ? i - 2 : i + 1);
  for (let i = 0; i < index.length; i += 1) {
    const key = ((index[i] as number) * 65_536 + (index[next(i)] as number)) >>> 0;
    table[slotOf(key)] = key;
  }
  const marked = new Uint8Array(vertices);
  let count = 0;
  const mark = (vertex: number): void => {
    if (marked[vertex] === 0) {
      marked[vertex] = 1;
      count += 1;
    }
  };
  for (let i = 0; i < index.length; i += 1) {
    const a = index[i] as number;
    const b = index[next(i)] as number;
    const reverse = (b * 65_536 + a) >>> 0;
    if (table[slotOf(reverse)] !== reverse) {
      mark(a);
      mark(b);
    }
  }
  const border = new Uint16Array(count);
  let used = 0;
  marked.forEach((isMarked, vertex) => {
    if (isMarked === 1) border[used++] = vertex;
  });
  return border;
}

// Parts of consecutive triangles, each with the vertices that it names: few enough for 16-bit indices.
export function split(whole: Triangles): Triangles[] {
  const { positions, index, distances } = whole;
  if (index.length <= 3 * mostTriangles && positions.length <= 3 * mostVertices) return [whole];
  const parts: Triangles[] = [];
  const newNumber = new Int32Array(positions.length / 3).fill(-1);
  const most = Math.floor(mostVertices / 3); // triangles that surely fit
  let begin = 0;
  while (begin < index.length) {
    const names: number[] = [];
    let end = begin;
    const limit = Math.min(index.length, begin + 3 * mostTriangles);
    while (end < limit && (names.length + 3 <= mostVertices || end - begin < 3 * most)) {
      for (let corner = 0; corner < 3; corner += 1) {
        const vertex = index[end + corner] as number;
        if (newNumber[vertex] === -1) {
          newNumber[vertex] = names.length;
          names.push(vertex);
        }
      }
      end += 3;
    }
    const part: Triangles = {
      positions: new Float32Array(3 * names.length),
      index: new Uint32Array(end - begin),
    };
    for (let i = begin; i < end; i += 1) {
      part.index[i - begin] = newNumber[index[i] as number] as number;
    }
    names.forEach((vertex, number) => {
      part.positions.set(positions.subarray(3 * vertex, 3 * vertex + 3), 3 * number);
      newNumber[vertex] = -1;
    });
    if (distances) part.distances = Float32Array.from(names, (vertex) => distances[vertex] as number);
    parts.push(part);
    begin = end;
  }
  return parts;
}

export function boundsOf(positions: ArrayLike<number>): [Vec3, Vec3] {
  const low: Vec3 = [Infinity, Infinity, Infinity];
  const high: Vec3 = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i += 1) {
    const axis = (i % 3) as 0 | 1 | 2;
    const value = positions[i] as number;
    if (value < low[axis]) low[axis] = value;
    if (value > high[axis]) high[axis] = value;
  }
  return [low, high];
}

// `hasCreases`: sharp edges are shaded as such.
export function prepare(whole: Triangles, hasCreases = false): Block {
  const border = borderVertices(whole.index, whole.positions.length / 3);
  const ofTriangles = triangleNormals(whole);
  const triangles = hasCreases ? splitCreases(whole, ofTriangles, border, mostVertices) : whole;
  const { positions, index } = triangles;
  const sums = vertexSums(triangles, ofTriangles);
  const normals = packedNormals(sums);
  const borderNormals = new Float32Array(3 * border.length);
  border.forEach((vertex, i) => {
    borderNormals.set(sums.subarray(3 * vertex, 3 * vertex + 3), 3 * i);
  });
  return {
    positions,
    index: Uint16Array.from(index),
    normals,
    border,
    borderNormals,
    bounds: boundsOf(positions),
    ...(triangles.distances && { distances: triangles.distances }),
  };
}
