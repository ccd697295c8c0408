// Shared by all readers in JavaScript: `main` reads the file that the command line names and prints one line of JSON:
// {version, surfaces: [{name, colour, triangles, vertices, bounds, normals, labels, values}]} or {version, error}.
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const modules = join(dirname(fileURLToPath(import.meta.url)), '../node_modules');

export function versionOf(name) {
  return JSON.parse(readFileSync(join(modules, name, 'package.json'), 'utf8')).version;
}

// The bytes of a file in a buffer of their own.
export function bytesOf(path) {
  return Uint8Array.from(readFileSync(path));
}

export function bytesOfModule(path) {
  return bytesOf(join(modules, path));
}

export const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

// `points` are x, y, z one after the other; `matrix` has 16 numbers, column by column. `more` has name, colour (#rrggbb),
// normals, labels, values.
export function surface(points, triangles, more = {}, matrix = identity) {
  const bounds = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  for (let at = 0; at < points.length; at += 3) {
    for (let axis = 0; axis < 3; axis += 1) {
      let value = matrix[12 + axis];
      for (let from = 0; from < 3; from += 1) value += matrix[4 * from + axis] * points[at + from];
      bounds[0][axis] = Math.min(bounds[0][axis], value);
      bounds[1][axis] = Math.max(bounds[1][axis], value);
    }
  }
  return { triangles, vertices: points.length / 3, bounds: points.length ? bounds : null, ...more };
}

// Linear red, green and blue from 0 to 1, as glTF has them.
export function hexOfLinear(values) {
  const encoded = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
  return hex([...values].slice(0, 3).map(encoded));
}

export function hex(values) {
  return `#${values.map((v) => Math.round(255 * v).toString(16).padStart(2, '0')).join('')}`;
}

// The colours of pixels of so many bytes, once each.
export function hexesOfBytes(bytes, stride) {
  const all = Array.from({ length: bytes.length / stride }, (_, at) => hex([...bytes.slice(stride * at, stride * at + 3)].map((v) => v / 255)));
  return [...new Set(all)];
}

// `read` takes the path and its suffix, and returns surfaces.
export async function main(name, read) {
  const path = process.argv[2];
  const answer = { version: versionOf(name) };
  try {
    answer.surfaces = await read(path, path.slice(path.lastIndexOf('.') + 1));
  } catch (error) {
    answer.error = String(error?.message ?? error).split('\n')[0];
  }
  process.stdout.write(`\n${JSON.stringify(answer)}\n`, () => process.exit(0));
}
