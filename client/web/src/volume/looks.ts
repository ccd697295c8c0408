// How a volume is looked through: which values are seen, how much of them and in which colour.
import type { Volume } from '../api/types';
import type { Window } from './slices';

export type LookName = 'bone' | 'soft tissue' | 'lung' | 'airways' | 'MR';

interface Stop {
  // Hounsfield units; of MR, which has no unit, parts of the window.
  at: number;
  // Of one sample's length, 0 to 1.
  opacity: number;
  colour: string;
}

interface Preset {
  name: LookName;
  stops: readonly Stop[];
  // How much less is seen where values hardly change: 0 leaves all, 1 only borders.
  edges: number;
}

const presets: readonly Preset[] = [
  {
    name: 'bone',
    edges: 0.2,
    stops: [
      { at: 130, opacity: 0, colour: '#8a4b32' },
      { at: 260, opacity: 0.1, colour: '#c98f62' },
      { at: 500, opacity: 0.5, colour: '#efdcb8' },
      { at: 1400, opacity: 0.9, colour: '#fffaf0' },
    ],
  },
  {
    name: 'soft tissue',
    edges: 0.75,
    stops: [
      { at: -160, opacity: 0, colour: '#d8a27c' },
      { at: -60, opacity: 0.05, colour: '#e0b08a' },
      { at: 20, opacity: 0.22, colour: '#c46a50' },
      { at: 90, opacity: 0.34, colour: '#b04a3c' },
      { at: 220, opacity: 0.3, colour: '#e2b48c' },
      { at: 500, opacity: 0.7, colour: '#fff3df' },
    ],
  },
  {
    name: 'lung',
    edges: 0.35,
    stops: [
      { at: -930, opacity: 0, colour: '#5d7fa8' },
      { at: -780, opacity: 0.03, colour: '#86a9c9' },
      { at: -560, opacity: 0.1, colour: '#d9a48f' },
      { at: -380, opacity: 0.14, colour: '#e8c4a8' },
      { at: -240, opacity: 0, colour: '#e8c4a8' },
    ],
  },
  {
    name: 'airways',
    edges: 1,
    stops: [
      { at: -980, opacity: 0, colour: '#3f7f96' },
      { at: -920, opacity: 0.4, colour: '#59a9be' },
      { at: -860, opacity: 0.5, colour: '#8fd0dc' },
      { at: -780, opacity: 0, colour: '#8fd0dc' },
    ],
  },
  {
    name: 'MR',
    edges: 0.55,
    stops: [
      { at: 0.16, opacity: 0, colour: '#5a3a2e' },
      { at: 0.3, opacity: 0.07, colour: '#a8735a' },
      { at: 0.55, opacity: 0.28, colour: '#d8b8a0' },
      { at: 1, opacity: 0.7, colour: '#fffaf2' },
    ],
  },
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
  const after = stops.findIndex((stop) => at < stop.at);
  const right = stops[after < 0 ? stops.length - 1 : after] as Stop;
  const left = stops[Math.max(0, after < 0 ? stops.length - 1 : after - 1)] as Stop;
  const part = right.at > left.at ? (at - left.at) / (right.at - left.at) : 0;
  const [from, to] = [rgbOf(left.colour), rgbOf(right.colour)];
  const mix = (a: number, b: number): number => a + (b - a) * Math.max(0, part);
  const opacity = after === 0 ? 0 : mix(left.opacity, right.opacity);
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
