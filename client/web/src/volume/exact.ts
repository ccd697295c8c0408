// Samples of slices as the volume has them, for values that a person reads off: a picture has only eight bits.
import { client } from '../client';
import type { Axis, SampleType, Vec3, Volume } from '../api/types';
import { formatNumber } from '../ui/format';
import { Signal, type Scope } from '../ui/signal';
import { axisIndex, pictureAxes } from './geometry';
import { Nearby } from './nearby';
import { sampleArrays } from './raw';

// The rows of a slice, one after the other.
export interface Samples {
  width: number;
  height: number;
  samples: InstanceType<(typeof sampleArrays)[SampleType]>;
}

// A pointer that rests for so long asks for its slice.
const restMilliseconds = 120;
const mostKept = 12;
// As many as a number of 32 bits needs; those of 64 bits are as short as JavaScript writes them.
const mostDigits = 9;

// The shortest text of decimals that is this sample, as a number.
export function plainValue(value: number, { samples }: Pick<Samples, 'samples'>): number {
  if (!(samples instanceof Float32Array)) return value;
  for (let digits = 1; digits < mostDigits; digits += 1) {
    const shorter = Number(value.toPrecision(digits));
    if (Math.fround(shorter) === value) return shorter;
  }
  return value;
}

export function exactText(value: number): string {
  return value !== 0 && Math.abs(value) < 1e-6 ? value.toExponential() : formatNumber(value, mostDigits);
}

export class ExactSamples {
  // More is here.
  readonly changes = new Signal(0);
  private readonly slices = new Nearby<Samples>(mostKept);
  private readonly wanted = new Map<Axis, number>();
  private timer = 0;
  private reading = 0;

  constructor(
    private readonly volume: Volume,
    private readonly scope: Scope,
  ) {
    scope.onEnd(() => clearTimeout(this.timer));
  }

  // Null until its slice is here, for which it asks once nobody moves.
  valueAt(axis: Axis, place: Vec3): number | null {
    const found = this.found(place);
    if (found === null) this.find(axis, place[axisIndex(axis)]);
    return found;
  }

  // Null until it is here, as above.
  find(axis: Axis, index: number): Samples | null {
    const found = this.slices.find(`${axis}${index}`);
    if (found || this.wanted.get(axis) === index) return found;
    this.wanted.set(axis, index);
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.fetch(), restMilliseconds);
    return null;
  }

  get(axis: Axis, index: number): Promise<Samples> {
    const { id, dims, type } = this.volume;
    return this.slices.get(`${axis}${index}`, async () => {
      const [column, row] = pictureAxes(axis);
      const samples = new sampleArrays[type](await client.samplesOfSlice(id, axis, index, this.scope.signal));
      return { width: dims[column], height: dims[row], samples };
    });
  }

  // Null if another place was asked for meanwhile: an answer that comes late must not replace a later one.
  async read(axis: Axis, place: Vec3): Promise<number | null> {
    this.reading += 1;
    const { reading } = this;
    const value = this.found(place) ?? valueIn(await this.get(axis, place[axisIndex(axis)]), axis, place);
    return reading === this.reading ? value : null;
  }

  // In any of the three slices through it.
  private found(place: Vec3): number | null {
    for (const axis of ['z', 'y', 'x'] as const) {
      const slice = this.slices.find(`${axis}${place[axisIndex(axis)]}`);
      if (slice) return valueIn(slice, axis, place);
    }
    return null;
  }

  private fetch(): void {
    for (const [axis, index] of this.wanted) {
      void this.get(axis, index)
        .then(() => (this.changes.value += 1), () => undefined) // What is seen stays as exact as the picture.
        .finally(() => this.wanted.get(axis) === index && this.wanted.delete(axis));
    }
  }
}

function valueIn(slice: Samples, axis: Axis, place: Vec3): number {
  const [column, row] = pictureAxes(axis);
  return plainValue(sampleIn(slice, place[column], place[row]), slice);
}

function sampleIn({ width, samples }: Samples, column: number, row: number): number {
  return samples[row * width + column] ?? NaN;
}

type Point = readonly [number, number];

// Along a line between two points of a slice, in whose samples they count: from the first to the last, linear between samples.
export function profileOf(slice: Samples, [from, to]: readonly [Point, Point]): number[] {
  const steps = Math.max(1, Math.min(512, Math.ceil(2 * Math.hypot(to[0] - from[0], to[1] - from[1]))));
  const inside = (value: number, count: number): number => Math.max(0, Math.min(count - 1, value));
  return Array.from({ length: steps + 1 }, (_, at) => {
    const x = inside(from[0] + (at / steps) * (to[0] - from[0]), slice.width);
    const y = inside(from[1] + (at / steps) * (to[1] - from[1]), slice.height);
    const [i, j] = [Math.floor(x), Math.floor(y)];
    const line = (row: number): number => {
      const [left, right] = [sampleIn(slice, i, row), sampleIn(slice, Math.min(slice.width - 1, i + 1), row)];
      return left + (right - left) * (x - i);
    };
    const upper = line(j);
    return upper + (line(Math.min(slice.height - 1, j + 1)) - upper) * (y - j);
  });
}

export interface Statistics {
  count: number;
  mean: number;
  deviation: number;
  least: number;
  greatest: number;
}

// The statistics of the samples whose middles lie within a polygon; null where there is none.
export function statisticsIn(slice: Samples, corners: readonly Point[]): Statistics | null {
  const values: number[] = [];
  for (let row = 0; row < slice.height; row += 1) {
    // The places where the row goes in and out.
    const crossings = corners
      .flatMap(([x, y], at) => {
        const [nextX, nextY] = corners[(at + 1) % corners.length] as Point;
        return y <= row === nextY <= row ? [] : [x + ((row - y) / (nextY - y)) * (nextX - x)];
      })
      .sort((a, b) => a - b);
    for (let at = 0; at + 1 < crossings.length; at += 2) {
      const [first = 0, last = 0] = crossings.slice(at);
      for (let column = Math.max(0, Math.ceil(first)); column <= Math.min(slice.width - 1, last); column += 1) {
        values.push(sampleIn(slice, column, row));
      }
    }
  }
  const { length: count } = values;
  if (count === 0) return null;
  const total = (of: (value: number) => number): number => values.reduce((sum, value) => sum + of(value), 0);
  const mean = total((value) => value) / count;
  const deviation = Math.sqrt(total((value) => (value - mean) ** 2) / count);
  const [least = NaN, greatest = NaN] = [Math.min, Math.max].map((best) => plainValue(values.reduce((a, b) => best(a, b)), slice));
  return { count, mean, deviation, least, greatest };
}
