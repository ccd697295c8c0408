import { Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { borderVertices, mostTriangles, prepare, split, type Block, type Triangles } from '@/mesh/blocks';
import { isReady, levelsOf, merged, simplified, type Coarse } from '@/mesh/coarse';
import { Seams } from '@/mesh/seams';

// A bumpy sheet of n x n squares over [x0, x0 + n] x [0, n].
function sheet(n: number, x0 = 0): Triangles {
  const positions: number[] = [];
  const index: number[] = [];
  for (let y = 0; y <= n; y += 1) {
    for (let x = 0; x <= n; x += 1) positions.push(x0 + x, y, Math.sin((x0 + x) / 3) + Math.cos(y / 4));
  }
  for (let y = 0; y < n; y += 1) {
    for (let x = 0; x < n; x += 1) {
      const a = y * (n + 1) + x;
      index.push(a, a + 1, a + n + 2, a, a + n + 2, a + n + 1);
    }
  }
  return { positions: new Float32Array(positions), index: new Uint32Array(index) };
}

function area({ positions, index }: { positions: Float32Array; index: ArrayLike<number> }): number {
  let sum = 0;
  const at = (corner: number): number[] => [0, 1, 2].map((axis) => positions[3 * (index[corner] as number) + axis] as number);
  for (let i = 0; i < index.length; i += 3) {
    const [a, b, c] = [at(i), at(i + 1), at(i + 2)] as [number[], number[], number[]];
    const u = b.map((value, axis) => value - (a[axis] as number)) as [number, number, number];
    const v = c.map((value, axis) => value - (a[axis] as number)) as [number, number, number];
    sum += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  }
  return sum;
}

describe('blocks', () => {
  it('finds the border of a sheet and none of a closed surface', () => {
    const { positions, index } = sheet(10);
    expect(borderVertices(index, positions.length / 3).length).toBe(40);
    const tetrahedron = [0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0];
    expect(borderVertices(tetrahedron, 4).length).toBe(0);
  });

  it('splits into parts that 16 bits number, without losing a triangle', () => {
    const whole = sheet(300);
    const parts = split(whole);
    expect(parts.length).toBeGreaterThan(2);
    for (const part of parts) {
      expect(part.index.length).toBeLessThanOrEqual(3 * mostTriangles);
      expect(part.positions.length / 3).toBeLessThanOrEqual(65_535);
    }
    expect(parts.reduce((sum, part) => sum + part.index.length, 0)).toBe(whole.index.length);
    expect(parts.reduce((sum, part) => sum + area(part), 0)).toBeCloseTo(area(whole), 1);
  });

  it('shades sharp edges as edges, and nothing else', () => {
    // A roof of two slopes with a ridge of five vertices, of which the ends are on the border.
    const roof = (rise: number): Triangles => {
      const positions: number[] = [];
      for (let y = 0; y < 5; y += 1) positions.push(-1, y, 0, 0, y, rise, 1, y, 0);
      const index: number[] = [];
      for (let a = 0; a < 12; a += 3) {
        index.push(a, a + 1, a + 4, a, a + 4, a + 3, a + 1, a + 2, a + 5, a + 1, a + 5, a + 4);
      }
      return { positions: new Float32Array(positions), index: new Uint32Array(index) };
    };
    const plain = prepare(roof(1));
    expect(plain.positions.length).toBe(45);
    expect(plain.normals[4 * 7]).toBe(0); // straight up
    const sharp = prepare(roof(1), true);
    expect(sharp.positions.length).toBe(45 + 9);
    expect(sharp.border).toEqual(plain.border);
    const slopes = [7, 15, 16, 17].map((vertex) => Math.round((sharp.normals[4 * vertex] as number) / 1000));
    expect(slopes.map(Math.abs)).toEqual([23, 23, 23, 23]); // 32.767 sin 45 degrees
    expect(area(sharp)).toBeCloseTo(area(plain), 5);
    expect(prepare(roof(0.2), true).positions.length).toBe(45);
    expect(prepare(sheet(20), true).positions).toEqual(prepare(sheet(20)).positions);
  });

  it('splits triangles that share no vertex', () => {
    const count = 70_000;
    const soup: Triangles = {
      positions: new Float32Array(9 * count),
      index: Uint32Array.from({ length: 3 * count }, (_, i) => i),
    };
    const parts = split(soup);
    expect(parts.reduce((sum, part) => sum + part.index.length, 0)).toBe(3 * count);
    expect(Math.max(...parts.map((part) => part.positions.length / 3))).toBeLessThanOrEqual(65_535);
  });

  it('has normals that point away from the outside of the winding', () => {
    const flat: Triangles = { positions: new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]), index: new Uint32Array([0, 1, 2]) };
    expect([...prepare(flat).normals.subarray(0, 3)]).toEqual([0, 0, 32_767]);
  });
});

describe('Seams', () => {
  it('gives vertices on a seam the normals that they had without it', () => {
    const left = prepare(sheet(20));
    const right = prepare(sheet(20, 20));
    const seams = new Seams();
    seams.add(left);
    seams.add(right);
    const at = (block: typeof left, vertex: number): number[] => [...block.normals.subarray(4 * vertex, 4 * vertex + 3)];
    const place = 10 * 21;
    expect(at(left, place + 20)).not.toEqual(at(right, place));
    expect(seams.join(0)).toBe(left);
    expect(seams.join(1)).toBe(right);
    expect(seams.join(2)).toBe(null);
    expect(at(left, place + 20)).toEqual(at(right, place));
    // The true normal of z = sin(x / 3) + cos(y / 4) at (20, 10).
    const slope = [-Math.cos(20 / 3) / 3, Math.sin(10 / 4) / 4, 1] as const;
    const cosine = at(right, place).reduce((sum, value, axis) => sum + (value / 32_767) * (slope[axis as 0]), 0) / Math.hypot(...slope);
    expect(cosine).toBeGreaterThan(0.995);
  });
});

function surfaceOf({ positions, normals, index, distances }: Block): Coarse {
  return { positions, normals, index: Uint32Array.from(index), ...(distances && { distances }) };
}

describe('a coarse copy', async () => {
  await isReady;

  it('has the shape of the surface, and faces as it does', () => {
    const whole = surfaceOf(prepare(sheet(100)));
    const coarse = simplified(whole, 1 / 20, false);
    expect(coarse.index.length).toBeLessThanOrEqual(whole.index.length / 20 + 3);
    expect(coarse.positions.length).toBeLessThan(whole.positions.length / 10);
    expect(area(coarse) / area(whole)).toBeGreaterThan(0.97);
    expect(turnedOver(coarse)).toBe(0);
    expect(simplified(whole, 1, false)).toBe(whole);
  });

  it('has no hole that the surface has not, also where blocks meet and where there are many', () => {
    const [left, right] = [surfaceOf(prepare(sheet(60))), surfaceOf(prepare(sheet(60, 60)))];
    const blocks = [left, right].map((block) => simplified(block, 1 / 8, true));
    const [made] = levelsOf([merged(blocks)], [400])[0] ?? [];
    if (!made) throw new Error('no copy');
    expect(made.index.length / 3).toBeLessThanOrEqual(410);
    // Edges that only one triangle has, by their ends' places: they are on the sheet's own border.
    const sides = new Map<string, number>();
    const at = (corner: number): number[] => [...made.positions.subarray(3 * (made.index[corner] as number), 3 * (made.index[corner] as number) + 3)];
    for (let i = 0; i < made.index.length; i += 1) {
      const ends = [at(i), at(i % 3 === 2 ? i - 2 : i + 1)];
      const key = ends.map(String).sort().join(' ');
      sides.set(key, (sides.get(key) ?? 0) + 1);
    }
    const isOuter = (text: string): boolean => {
      const [x = 0, y = 0] = text.split(',').map(Number);
      return x === 0 || x === 120 || y === 0 || y === 60;
    };
    const open = [...sides].filter(([, count]) => count === 1).map(([key]) => key);
    expect(open.length).toBeGreaterThan(4);
    expect(open.filter((key) => !key.split(' ').every(isOuter))).toEqual([]);
  });

  it('of several surfaces has about so many triangles together, each its part', () => {
    const [left, right] = [surfaceOf(prepare(sheet(80))), surfaceOf(prepare(sheet(40, 80)))];
    const levels = levelsOf([left, right], [40_000, 4000, 1000]);
    const counts = levels.map((surfaces) => surfaces.map(({ index }) => index.length / 3));
    expect(counts[0]).toEqual([12_800, 3200]);
    for (const [level, most] of [[1, 4000], [2, 1000]] as const) {
      const [a = 0, b = 0] = counts[level] ?? [];
      expect(Math.abs(a + b - most)).toBeLessThan(0.02 * most);
      expect(a / b).toBeCloseTo(4, 0);
    }
    for (const { positions, normals, index } of levels.flat()) {
      expect(normals.length / 4).toBe(positions.length / 3);
      expect(Math.max(...index)).toBe(positions.length / 3 - 1);
    }
  });

  it('of nothing, or of points, ends', () => {
    expect(levelsOf([merged([])], [8, 4]).flat().map(({ index }) => index.length)).toEqual([0, 0]);
    const point: Coarse = { positions: new Float32Array(9), normals: new Int16Array(12), index: Uint32Array.from([0, 1, 2, 0, 1, 2]) };
    expect(levelsOf([point], [1]).flat().map(({ index }) => index.length / 3 <= 2)).toEqual([true]);
  });

  it('keeps distances with their vertices', () => {
    const whole = sheet(60);
    const distances = Float32Array.from({ length: whole.positions.length / 3 }, (_, vertex) => whole.positions[3 * vertex] as number);
    const coarse = simplified(surfaceOf(prepare({ ...whole, distances })), 1 / 8, false);
    const all = merged([surfaceOf(prepare(sheet(20, 60))), coarse]);
    const behind = all.positions.length / 3 - coarse.positions.length / 3;
    coarse.distances?.forEach((distance, vertex) => {
      expect(distance).toBe(coarse.positions[3 * vertex]);
      expect(all.distances?.[behind + vertex]).toBe(distance);
    });
    expect(coarse.distances?.length).toBe(coarse.positions.length / 3);
  });
});

// How many triangles face away from where the normals of their vertices point.
function turnedOver({ positions, normals, index }: Coarse): number {
  let turned = 0;
  for (let i = 0; i < index.length; i += 3) {
    const vertices = [...index.subarray(i, i + 3)];
    const [a, b, c] = vertices.map((vertex) => new Vector3().fromArray(positions, 3 * vertex)) as [Vector3, Vector3, Vector3];
    const face = b.sub(a).cross(c.sub(a));
    const mean = new Vector3();
    for (const vertex of vertices) mean.add(new Vector3().fromArray(normals, 4 * vertex));
    if (face.dot(mean) < 0) turned += 1;
  }
  return turned;
}
