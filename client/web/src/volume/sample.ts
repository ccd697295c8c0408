// A volume to try the page with where there is none: a head of ellipsoids, in Hounsfield units.
import type { NamedFile } from './tar';

const size = 112;
const spacing = 2; // mm

interface Ellipsoid {
  middle: readonly [number, number, number];
  radii: readonly [number, number, number];
  value: number;
}

// In millimetres from the middle of the head; each lies over those before it.
const parts: readonly Ellipsoid[] = [
  { middle: [0, 24, -84], radii: [50, 52, 70], value: 40 },
  { middle: [0, 34, -80], radii: [13, 15, 70], value: 700 },
  { middle: [0, -46, -52], radii: [45, 39, 42], value: 40 },
  { middle: [0, 0, 10], radii: [78, 96, 86], value: 40 },
  { middle: [0, -94, -14], radii: [11, 14, 20], value: 40 },
  { middle: [78, 10, -14], radii: [7, 14, 24], value: 40 },
  { middle: [-78, 10, -14], radii: [7, 14, 24], value: 40 },
  { middle: [0, -42, -48], radii: [39, 36, 38], value: 900 },
  { middle: [0, -22, -60], radii: [33, 49, 32], value: 45 },
  { middle: [0, -64, -50], radii: [40, 22, 3], value: 40 },
  { middle: [0, 0, 12], radii: [72, 90, 78], value: 950 },
  { middle: [0, 4, 12], radii: [65, 82, 71], value: 35 },
  { middle: [16, 8, 16], radii: [8, 34, 16], value: 5 },
  { middle: [-16, 8, 16], radii: [8, 34, 16], value: 5 },
  { middle: [30, -70, -4], radii: [17, 20, 15], value: 15 },
  { middle: [-30, -70, -4], radii: [17, 20, 15], value: 15 },
  { middle: [0, -72, -26], radii: [9, 17, 12], value: -950 },
  { middle: [0, -80, 24], radii: [20, 6, 9], value: -950 },
];
const air = -1000;
// Over which a border rises, as a scanner's does.
const blur = 1.6;

function sampleAt(x: number, y: number, z: number): number {
  let value = air;
  for (const { middle, radii, value: own } of parts) {
    const [dx, dy, dz] = [(x - middle[0]) / radii[0], (y - middle[1]) / radii[1], (z - middle[2]) / radii[2]];
    if (Math.max(Math.abs(dx), Math.abs(dy), Math.abs(dz)) > 1.6) continue;
    const depth = (1 - Math.hypot(dx, dy, dz)) * Math.min(...radii);
    const part = Math.max(0, Math.min(1, 0.5 + depth / (2 * blur)));
    value += (own - value) * part;
  }
  return value;
}

export function sampleHead(): NamedFile {
  const samples = new Int16Array(size ** 3);
  const middle = (size - 1) / 2;
  let at = 0;
  for (let k = 0; k < size; k += 1) {
    for (let j = 0; j < size; j += 1) {
      for (let i = 0; i < size; i += 1) {
        samples[at] = Math.round(sampleAt((i - middle) * spacing, (j - middle) * spacing, (k - middle) * spacing));
        at += 1;
      }
    }
  }
  const bytes = new DataView(samples.buffer);
  // NRRD says its byte order; the header below says little.
  if (new Uint8Array(Int16Array.of(1).buffer)[0] !== 1) samples.forEach((value, i) => bytes.setInt16(2 * i, value, true));
  const header = [
    'NRRD0004',
    'type: int16',
    'dimension: 3',
    'space: left-posterior-superior',
    `sizes: ${size} ${size} ${size}`,
    `space directions: (${spacing},0,0) (0,${spacing},0) (0,0,${spacing})`,
    'space origin: (-111,-111,-111)',
    'endian: little',
    'encoding: raw',
    '',
    '',
  ].join('\n');
  return { path: 'Sample head.nrrd', file: new Blob([header, samples.buffer]) };
}
