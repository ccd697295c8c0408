// The iso-contour of one slice by marching squares: where the surface will cut it. Samples at the
// iso-value are inside, as in the mesh.

// A slice of samples, row by row.
export interface Samples {
  width: number;
  height: number;
  values: ArrayLike<number>;
}

// Which edges of a cell the contour joins, by its corners (bit 0: top left, 1: top right, 2: bottom
// right, 3: bottom left). Edges: 0 top, 1 right, 2 bottom, 3 left. The two cells with opposite
// corners inside keep those corners apart.
const cases: readonly (readonly number[])[] = [
  [], [3, 0], [0, 1], [3, 1], [1, 2], [3, 0, 1, 2], [0, 2], [3, 2],
  [2, 3], [2, 0], [0, 1, 2, 3], [2, 1], [1, 3], [1, 0], [0, 3], [],
]; // prettier-ignore

// Line segments x0, y0, x1, y1, ... in samples: (0,0) is the first sample's place.
export function contour({ width, height, values }: Samples, iso: number): Float32Array {
  let segments = new Float32Array(4096);
  let used = 0;
  const at = (index: number): number => values[index] ?? 0;
  const crossing = (a: number, b: number): number => (a === b ? 0.5 : (iso - a) / (b - a));

  const put = (edge: number, x: number, y: number, corner: number): void => {
    let px = x;
    let py = y;
    if (edge === 0) px += crossing(at(corner), at(corner + 1));
    else if (edge === 1) {
      px += 1;
      py += crossing(at(corner + 1), at(corner + width + 1));
    } else if (edge === 2) {
      px += crossing(at(corner + width), at(corner + width + 1));
      py += 1;
    } else py += crossing(at(corner), at(corner + width));
    segments[used] = px;
    segments[used + 1] = py;
    used += 2;
  };

  for (let y = 0; y + 1 < height; y += 1) {
    for (let x = 0; x + 1 < width; x += 1) {
      const corner = y * width + x;
      const code =
        (at(corner) >= iso ? 1 : 0) |
        (at(corner + 1) >= iso ? 2 : 0) |
        (at(corner + width + 1) >= iso ? 4 : 0) |
        (at(corner + width) >= iso ? 8 : 0);
      const edges = cases[code];
      if (edges === undefined || edges.length === 0) continue;
      if (used + 8 > segments.length) {
        const larger = new Float32Array(segments.length * 2);
        larger.set(segments);
        segments = larger;
      }
      for (const edge of edges) put(edge, x, y, corner);
    }
  }
  return segments.subarray(0, used);
}
