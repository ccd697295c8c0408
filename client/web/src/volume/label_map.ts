// Labels in pictures of eight bits: which windows tell their values exactly, and what is drawn of them.
import type { Label } from '../api/types';
import { rgbOf } from './looks';
import type { Window } from './slices';

export interface MappedLabel {
  label: Label;
  name?: string | null;
  color?: string | null;
}

// Of a picture over [low, low + 255] the values 1 to 254 are exactly low + 1 to low + 254; 0 and 255 may be anything beyond.
const exactValues = 254;
// Each is a request for each slice.
const mostWindows = 8;
const mostSample = 2 ** 32 - 1;
// Labels whose numbers fit into eight bits.
export const mostInBytes = 255;

let lastKey = 0;

// Numbers the labels from 1; 0 is none of them.
export class LabelMap {
  readonly windows: readonly Window[];
  // No other map has it.
  readonly key: string;
  private readonly numbers: ReadonlyMap<number, number>;

  constructor(readonly labels: readonly MappedLabel[]) {
    lastKey += 1;
    this.key = `labels-${lastKey}`;
    const samples = labels.flatMap(({ label }) => (typeof label === 'number' && label <= mostSample ? [label] : []));
    // Labels of more bits than samples: these have other numbers, which say nothing here.
    const areSamples = samples.length === labels.length;
    this.numbers = new Map(areSamples ? samples.map((sample, at) => [sample, at + 1]) : []);
    this.windows = windowsOf(areSamples ? samples : []);
  }

  // Writes the numbers of the labels that a picture over that window shows.
  take(values: Uint8Array, [low]: Window, into: Uint8Array | Uint16Array): void {
    const table = Array.from({ length: 256 }, (_, value) =>
      value >= 1 && value <= exactValues ? (this.numbers.get(low + value) ?? 0) : 0,
    );
    for (let i = 0; i < values.length; i += 1) {
      const number = table[values[i] as number] as number;
      if (number !== 0) into[i] = number;
    }
  }

  at(number: number): MappedLabel | null {
    return this.labels[number - 1] ?? null;
  }
}

// As few as hold all labels, as far as there may be so many.
export function windowsOf(labels: readonly number[]): Window[] {
  const windows: Window[] = [];
  for (const label of [...labels].sort((a, b) => a - b)) {
    const last = windows.at(-1);
    if (last && label <= last[0] + exactValues) continue;
    if (windows.length === mostWindows) break;
    windows.push([label - 1, label + exactValues]);
  }
  return windows;
}

const goldenPart64 = 0x9e3779b97f4a7c15n;

// The fractional part of that many golden sections. A number would lose it beyond 32 bits: there it is in units of 2^-64.
function goldenPart(label: Label): number {
  const turns = Number(label) * 0.6180339887498949;
  if (Math.abs(Number(label)) <= 2 ** 32) return turns - Math.floor(turns);
  return Number(BigInt.asUintN(64, BigInt(label) * goldenPart64) >> 11n) / 2 ** 53;
}

// A golden section of the circle of hues from one label to the next: the series of the surfaces' files.
export function seriesColour(label: Label): string {
  const hue = 6 * goldenPart(label);
  const digits = [0, 1, 2].map((channel) => {
    const k = (5 - 2 * channel + hue) % 6;
    const part = 0.9 * (1 - 0.5 * Math.max(0, Math.min(k, 4 - k, 1)));
    return Math.round(255 * part).toString(16).padStart(2, '0');
  });
  return `#${digits.join('')}`;
}

export function colourOf({ label, color }: MappedLabel): string {
  return color ?? seriesColour(label);
}

// How labels are seen.
export interface LabelLook {
  map: LabelMap;
  colourOf: (label: Label) => string;
  isShown: (label: Label) => boolean;
}

// In the colours of the file, or of the series.
export function lookOf(labels: readonly MappedLabel[], isShown: LabelLook['isShown'] = () => true): LabelLook {
  const colours = new Map(labels.map((one) => [one.label, colourOf(one)]));
  return { map: new LabelMap(labels), colourOf: (label) => colours.get(label) ?? seriesColour(label), isShown };
}

// Red, green, blue and opacity of each number; nothing is seen of 0 and of what is hidden.
export function coloursOf({ map, colourOf: colour, isShown }: LabelLook): Uint8Array<ArrayBuffer> {
  const table = new Uint8Array(4 * (map.labels.length + 1));
  map.labels.forEach(({ label }, at) => {
    if (isShown(label)) table.set([...rgbOf(colour(label)), 255], 4 * (at + 1));
  });
  return table;
}

export interface NumberedSlice {
  width: number;
  height: number;
  // Of the labels, row by row.
  labels: ArrayLike<number>;
}

// The pixels of a slice: samples at the border of a label are seen as they are, those within with that opacity.
export function paintLabels({ width, height, labels }: NumberedSlice, table: Uint8Array, opacity: number): Uint8ClampedArray<ArrayBuffer> {
  const pixels = new Uint8ClampedArray(4 * width * height);
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) {
      const at = y * width + x;
      const number = labels[at] as number;
      if (table[4 * number + 3] === 0) continue;
      const isBorder =
        (x > 0 && labels[at - 1] !== number) ||
        (x + 1 < width && labels[at + 1] !== number) ||
        (y > 0 && labels[at - width] !== number) ||
        (y + 1 < height && labels[at + width] !== number);
      for (let channel = 0; channel < 3; channel += 1) pixels[4 * at + channel] = table[4 * number + channel] as number;
      pixels[4 * at + 3] = isBorder ? 255 : 255 * opacity;
    }
  }
  return pixels;
}
