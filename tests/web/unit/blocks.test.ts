import { Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { borderVertices, coarseCell, mostTriangles, prepare, split, type Triangles } from '@/mesh/blocks';
import { clustered, levelsOf, merged, type Coarse } from '@/mesh/coarse';
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
    const sharp = prepare(roof(1), 0, true);
    expect(sharp.positions.length).toBe(45 + 9);
    expect(sharp.border).toEqual(plain.border);
    const slopes = [7, 15, 16, 17].map((vertex) => Math.round((sharp.normals[4 * vertex] as number) / 1000));
    expect(slopes.map(Math.abs)).toEqual([23, 23, 23, 23]); // 32.767 sin 45 degrees
    expect(area(sharp)).toBeCloseTo(area(plain), 5);
    expect(prepare(roof(0.2), 0, true).positions.length).toBe(45);
    expect(prepare(sheet(20), 0, true).positions).toEqual(prepare(sheet(20)).positions);
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

  it('keeps the shape with far fewer triangles while it is turned', () => {
    const whole = sheet(100);
    const { coarse, border, normals } = prepare(whole);
    expect(coarse.index.length).toBeLessThan(whole.index.length / 4);
    expect(coarse.positions.length).toBeLessThan(whole.positions.length / 4);
    expect(area(coarse) / area(whole)).toBeGreaterThan(0.85);
    const coarser = prepare(whole, 7).coarse;
    expect(coarser.index.length).toBeLessThan(coarse.index.length / 1.5);
    expect(area(coarser) / area(whole)).toBeGreaterThan(0.7);
    expect(clustered({ ...whole, normals }, border, { size: 0, areByOctant: true }).length).toBe(whole.index.length);
  });

  it('opens no gap between neighbours while they are turned', () => {
    const left = sheet(40);
    const right = sheet(40, 40);
    const cell = 7;
    // Without the ends, where other borders are in the same cell.
    const onSeam = ({ positions, index }: Triangles | Coarse): number[][] =>
      [...index]
        .map((vertex) => [...positions.subarray(3 * vertex, 3 * vertex + 3)])
        .filter(([x = 0, y = 0]) => x === 40 && y >= cell && y < 35);
    const least = new Map<string, number[]>();
    for (const place of onSeam(left)) {
      const key = place.map((value) => Math.floor(value / cell)).join();
      const before = least.get(key);
      if (!before || (place[1] as number) < (before[1] as number)) least.set(key, place);
    }
    const expected = new Set([...least.values()].map(String));
    for (const side of [left, right]) {
      const named = new Set(onSeam(prepare(side, cell).coarse).map(String));
      expect([...named].filter((place) => !expected.has(place))).toEqual([]);
      expect(named.size).toBeGreaterThan(3);
    }
  });

  it('leaves some ten thousand triangles of a large surface', () => {
    const whole = sheet(500);
    const cell = coarseCell(area(whole));
    const kept = split(whole).reduce((sum, part) => sum + prepare(part, cell).coarse.index.length / 3, 0);
    expect(kept).toBeGreaterThan(5_000);
    expect(kept).toBeLessThan(50_000);
  });

  it('keeps both sides of a wall that is thinner than a cell', () => {
    const front = sheet(40);
    const vertices = front.positions.length / 3;
    const back = front.positions.map((value, i) => (i % 3 === 2 ? value - 0.2 : value));
    const wall: Triangles = {
      positions: Float32Array.from([...front.positions, ...back]),
      index: Uint32Array.from([...front.index, ...[...front.index].reverse().map((vertex) => vertex + vertices)]),
    };
    const { coarse } = prepare(wall);
    // The normals of the back point down.
    const behind = [...coarse.index].filter((vertex) => (coarse.normals[4 * vertex + 2] ?? 0) < 0).length;
    expect(behind / coarse.index.length).toBeGreaterThan(0.4);
    expect(behind / coarse.index.length).toBeLessThan(0.6);
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

describe('a coarse copy', () => {
  // One that is turned over would be dark, or of a label's surface a hole.
  it('faces as the surface does', () => {
    const size = 60;
    const positions = new Float32Array(3 * size * size);
    const index: number[] = [];
    for (let y = 0; y < size; y += 1) {
      for (let x = 0; x < size; x += 1) {
        const height = 3 * Math.sin(x * 1.7) * Math.cos(y * 1.3);
        positions.set([x, y, height], 3 * (y * size + x));
        const a = y * size + x;
        if (x + 1 < size && y + 1 < size) index.push(a, a + 1, a + size, a + 1, a + size + 1, a + size);
      }
    }
    const { coarse } = prepare({ positions, index: Uint32Array.from(index) });
    expect(coarse.index.length).toBeGreaterThan(300);
    expect(turnedOver(coarse)).toBe(0);
    const levels = levelsOf([coarse], [200, 100]);
    for (const [level] of levels) {
      expect(level?.index.length).toBeGreaterThan(30);
      expect(level && turnedOver(level)).toBe(0);
    }
  });

  it('of several surfaces has at most so many triangles together, by the same cells', () => {
    const left = prepare(sheet(80)).coarse;
    const right = prepare(sheet(80, 80)).coarse;
    const before = left.index.length / 3;
    const most = [10_000, Math.floor(before), Math.floor(before / 3)];
    const levels = levelsOf([left, right], most);
    const counts = levels.map((surfaces) => surfaces.map(({ index }) => index.length / 3));
    expect(counts[0]).toEqual([before, right.index.length / 3]);
    counts.forEach(([a = 0, b = 0], level) => {
      expect(a + b).toBeLessThanOrEqual(most[level] ?? 0);
      expect(a + b).toBeGreaterThan(0.25 * Math.min(most[level] ?? 0, 2 * before));
      expect(a / b).toBeGreaterThan(0.6);
      expect(a / b).toBeLessThan(1.6);
    });
    for (const surfaces of levels) {
      for (const { positions, normals, index } of surfaces) {
        expect(normals.length / 4).toBe(positions.length / 3);
        expect(Math.max(...index)).toBe(positions.length / 3 - 1);
      }
    }
  });

  it('of nothing, or of points, ends', () => {
    const none = merged([]);
    expect(levelsOf([none], [8, 4]).flat().map(({ index }) => index.length)).toEqual([0, 0]);
    const point: Coarse = { positions: new Float32Array(9), normals: new Int16Array(12), index: Uint32Array.from([0, 1, 2, 0, 1, 2]) };
    expect(levelsOf([point], [1]).flat().map(({ index }) => index.length)).toEqual([0]);
  });

  it('keeps distances with their vertices', () => {
    const whole = sheet(60);
    const distances = Float32Array.from({ length: whole.positions.length / 3 }, (_, vertex) => whole.positions[3 * vertex] as number);
    const { coarse } = prepare({ ...whole, distances });
    const all = merged([prepare(sheet(20, 60)).coarse, coarse]);
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
