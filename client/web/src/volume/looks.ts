// How a volume is looked through: which values are seen, how much of them and in which colour.
import type { Volume } from '../api/types';
import type { Window } from './slices';

export type LookName = 'bone' | 'soft tissue' | 'lung' | 'airways' | 'MR';

// A value in Hounsfield units, or of MR, which has no unit, a part of the window; how much is seen of one sample's length, 0 to 1.
type Stop = readonly [at: number, opacity: number, colour: string];

interface Preset {
  name: LookName;
  stops: readonly Stop[];
  // How much less is seen where values hardly change: 0 leaves all, 1 only borders.
  edges: number;
}

const presets: readonly Preset[] = [
  { name: 'bone', edges: 0.2, stops: [[130, 0, '#8a4b32'], [260, 0.1, '#c98f62'], [500, 0.5, '#efdcb8'], [1400, 0.9, '#fffaf0']] },
  { name: 'soft tissue', edges: 0.75, stops: [[-160, 0, '#d8a27c'], [-60, 0.05, '#e0b08a'], [20, 0.22, '#c46a50'], [90, 0.34, '#b04a3c'], [220, 0.3, '#e2b48c'], [500, 0.7, '#fff3df']] },
  { name: 'lung', edges: 0.35, stops: [[-930, 0, '#5d7fa8'], [-780, 0.03, '#86a9c9'], [-560, 0.1, '#d9a48f'], [-380, 0.14, '#e8c4a8'], [-240, 0, '#e8c4a8']] },
  { name: 'airways', edges: 1, stops: [[-980, 0, '#3f7f96'], [-920, 0.4, '#59a9be'], [-860, 0.5, '#8fd0dc'], [-780, 0, '#8fd0dc']] },
  { name: 'MR', edges: 0.55, stops: [[0.16, 0, '#5a3a2e'], [0.3, 0.07, '#a8735a'], [0.55, 0.28, '#d8b8a0'], [1, 0.7, '#fffaf2']] },
];

export interface Look {
  // Red, green, blue and opacity of each of 256 values of the window.
  table: Uint8Array<ArrayBuffer>;
  edges: number;
}

// CT is told by its values where a file does not say: nothing else goes so far below water.
export function isCt({ modality, range }: Pick<Volume, 'modality' | 'range'>): boolean {
  return modality === 'CT' || (modality === null && range[0] <= -500);
}

export function looksFor(volume: Pick<Volume, 'modality' | 'range'>): LookName[] {
  return presets.map(({ name }) => name).filter((name) => isCt(volume) !== (name === 'MR'));
}

export function rgbOf(colour: string): [number, number, number] {
  const value = Number.parseInt(colour.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}

// Beyond the last stop all is as there; before the first nothing is seen.
function between(stops: readonly Stop[], at: number): [number, number, number, number] {
  const after = stops.findIndex(([end]) => at < end);
  const right = stops[after < 0 ? stops.length - 1 : after] as Stop;
  const left = stops[Math.max(0, after < 0 ? stops.length - 1 : after - 1)] as Stop;
  const part = right[0] > left[0] ? (at - left[0]) / (right[0] - left[0]) : 0;
  const [from, to] = [rgbOf(left[2]), rgbOf(right[2])];
  const mix = (a: number, b: number): number => a + (b - a) * Math.max(0, part);
  const opacity = after === 0 ? 0 : mix(left[1], right[1]);
  return [mix(from[0], to[0]), mix(from[1], to[1]), mix(from[2], to[2]), 255 * opacity];
}

// Of a volume whose eight bits are spread over that window.
export function lookOf(name: LookName, [low, high]: Window): Look {
  const preset = presets.find((one) => one.name === name) as Preset;
  const table = new Uint8Array(4 * 256);
  for (let value = 0; value < 256; value += 1) {
    const part = value / 255;
    table.set(between(preset.stops, name === 'MR' ? part : low + part * (high - low)).map(Math.round), 4 * value);
  }
  return { table, edges: preset.edges };
}

// For each value the sum of the opacities of all below it: what lies between two is seen where theirs differ.
export function sumsOf({ table }: Look): Float32Array<ArrayBuffer> {
  const sums = new Float32Array(257);
  for (let value = 0; value < 256; value += 1) sums[value + 1] = (sums[value] as number) + (table[4 * value + 3] as number);
  return sums;
}
