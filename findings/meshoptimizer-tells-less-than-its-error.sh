#!/bin/sh
# Guess: the error that meshoptimizer's simplifier returns, and limits, is about the largest distance between the two surfaces. The README says
#   "an approximate measure of the deviation", and ErrorAbsolute makes it a length.
# Seen: a spike of 10 mm on a ball of 10 mm radius disappears with a limit of 0.5 mm, and the error returned is 0.49 mm: a twentieth of the
#   distance. The spike is about 1 mm wide. With a limit of 0.3 mm it stays. Without a spike, the ball's distance is 1.5 times the
#   error returned, or more. No search measures these distances: the tip is that much farther from the origin than all vertices that are
#   left, and the centre of a triangle is that much nearer to it than all points of the ball.
# Packages: npm meshoptimizer 1.3.0. Date: 2026-11-29.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save meshoptimizer@1.3.0 >npm.log 2>&1
cat >simplify.mjs <<'M'
import { MeshoptSimplifier } from 'meshoptimizer';
await MeshoptSimplifier.ready;
const scaled = (point, length) => point.map((x) => (x * length) / Math.hypot(...point));
let points = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
for (let level = 0; level < 5; ++level) {
  const middles = new Map();
  const middle = (a, b) => {
    const key = `${Math.min(a, b)} ${Math.max(a, b)}`;
    if (!middles.has(key)) middles.set(key, points.push(points[a].map((x, at) => x + points[b][at])) - 1);
    return middles.get(key);
  };
  faces = faces.flatMap(([a, b, c]) => {
    const [x, y, z] = [middle(a, b), middle(b, c), middle(c, a)];
    return [[a, x, z], [x, b, y], [z, y, c], [x, y, z]];
  });
  points = points.map((point) => scaled(point, 10));
}
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
for (const tip of [10, 20]) {
  points[4] = [0, 0, tip];
  const positions = Float32Array.from(points.flat());
  const corners = (indices) => Array.from({ length: indices.length / 3 }, (_, at) =>
    [0, 1, 2].map((corner) => Array.from(positions.subarray(3 * indices[3 * at + corner]).subarray(0, 3))));
  const indices = Uint32Array.from(faces.flat());
  const lowest = Math.min(...corners(indices).map(([a, b, c]) => {
    const normal = cross(b.map((x, at) => x - a[at]), c.map((x, at) => x - a[at]));
    return Math.abs(normal.reduce((sum, x, at) => sum + x * a[at], 0)) / Math.hypot(...normal);
  }));
  for (const limit of [0.3, 0.5]) {
    const [simplified, error] = MeshoptSimplifier.simplify(indices, positions, 3, 0, limit, ['ErrorAbsolute']);
    const left = corners(simplified);
    const farthest = Math.max(...left.flat().map((point) => Math.hypot(...point)));
    const centres = left.map((triangle) => Math.hypot(...[0, 1, 2].map((at) => triangle.reduce((sum, point) => sum + point[at] / 3, 0))));
    const distance = tip > 10 ? tip - farthest : lowest - Math.min(...centres);
    const name = tip > 10 ? 'spike' : 'ball';
    console.log(`${name}, limit ${limit}: ${left.length} triangles, error ${error.toFixed(3)}, distance at least ${distance.toFixed(3)}`);
  }
}
M
seen=$(node simplify.mjs)
echo "$seen"
[ "$seen" = 'ball, limit 0.3: 254 triangles, error 0.299, distance at least 0.506
ball, limit 0.5: 170 triangles, error 0.477, distance at least 0.694
spike, limit 0.3: 268 triangles, error 0.300, distance at least 0.000
spike, limit 0.5: 158 triangles, error 0.494, distance at least 10.000' ] || { echo changed; exit 1; }
