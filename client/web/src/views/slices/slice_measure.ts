// Lengths, angles and areas that a person draws in slices: those of three planes together.
import type { Vec3, Volume } from '../../api/types';
import { formatValue } from '../../ui/format';
import { Signal } from '../../ui/signal';
import { pictureAxes, axisIndex, toPatient, type Plane, type SlicePlane } from '../../volume/geometry';
import { exactText, plainValue, profileOf, statisticsIn, type Samples } from '../../volume/exact';
import { measureText, pointsOf, type MeasureKind } from '../../volume/measure';
import { measuresOfText, measuresToText, type Measure, type Point } from './slice_texts';

const colour = '#ffd166';
const fontSize = 12;

export class SliceMeasures {
  // What the next click begins; null: clicks move the slices.
  readonly kind = new Signal<MeasureKind | null>(null);
  // They are to be drawn anew.
  readonly changes = new Signal<number>(0);
  private measures: Measure[];
  // Those that are whole.
  private readonly values = new WeakMap<Measure, string>();

  // As an address says.
  constructor(text = '') {
    this.measures = measuresOfText(text);
  }

  // For the address.
  get text(): string {
    return measuresToText(this.measures);
  }

  get lastLength(): Measure | undefined {
    return this.measures.filter(({ kind, isWhole }) => kind === 'length' && isWhole).at(-1);
  }

  // Takes a click; false if it is none of a measurement's.
  take(plane: Plane, index: number, point: Point): boolean {
    const kind = this.kind.value;
    if (kind === null) return false;
    const last = this.measures.at(-1);
    const isOn = last && !last.isWhole && last.kind === kind && last.plane === plane && last.index === index;
    if (!isOn) this.measures = this.measures.filter(({ isWhole }) => isWhole);
    const measure = isOn ? last : { kind, plane, index, points: [], isWhole: false };
    if (!isOn) this.measures.push(measure);
    measure.points.push(point);
    measure.isWhole = measure.points.length >= pointsOf[kind];
    this.changed();
    return true;
  }

  // Closes an area. Its last point came twice, as a double click is two clicks.
  finish(): boolean {
    const last = this.measures.at(-1);
    if (last?.kind !== 'area' || last.isWhole) return this.kind.value !== null;
    const [before, end] = last.points.slice(-2);
    if (before && end && Math.hypot(before[0] - end[0], before[1] - end[1]) < 1) last.points.pop();
    if (last.points.length < 3) this.measures.pop();
    last.isWhole = true;
    this.changed();
    return true;
  }

  takeBack(): void {
    this.measures.pop();
    this.changed();
  }

  clear(): void {
    this.measures = [];
    this.changed();
  }

  // Those of that slice and what they say, for who draws and for who hears them.
  textsOf(volume: Volume, { plane, normal }: SlicePlane, index: number, samples: () => Samples | null): { points: readonly Point[]; text: string; isClosed: boolean }[] {
    return this.measures
      .filter((one) => one.plane === plane && one.index === index)
      .map((measure) => {
        const { kind, points, isWhole } = measure;
        const size = isWhole || kind === 'area' ? measureText(kind, points.map((point) => inPatient(volume, normal, index, point))) : '';
        const values = isWhole && kind !== 'angle' ? this.valuesIn(measure, samples()) : '';
        return { points, text: [size, values].filter(Boolean).join(', '), isClosed: kind === 'area' && isWhole };
      });
  }

  // They are drawn many times while they stay.
  private valuesIn(measure: Measure, samples: Samples | null): string {
    const known = this.values.get(measure);
    if (known !== undefined || !samples) return known ?? '';
    const text = valuesText(measure, samples);
    this.values.set(measure, text);
    return text;
  }

  // With the slice's samples as units, from the middle of the first one.
  paint(context: CanvasRenderingContext2D, ratio: number, measures: ReturnType<SliceMeasures['textsOf']>): void {
    const at = context.getTransform();
    for (const { points, text, isClosed } of measures) {
      const places = points.map(([x, y]) => at.transformPoint({ x, y }));
      context.save();
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.beginPath();
      places.forEach(({ x, y }) => context.lineTo(x, y));
      if (isClosed) context.closePath();
      context.lineWidth = 1.5 * ratio;
      context.strokeStyle = context.fillStyle = colour;
      context.stroke();
      for (const { x, y } of places) context.fillRect(x - 2 * ratio, y - 2 * ratio, 4 * ratio, 4 * ratio);
      // Below all of it, so that it covers none.
      const lowest = places.reduce<{ x: number; y: number }>((one, next) => (next.y < one.y ? one : next), { x: 0, y: -Infinity });
      if (text !== '') paintText(context, text, lowest.x + 8 * ratio, Math.min(lowest.y + 16 * ratio, context.canvas.height - fontSize * ratio), ratio);
      context.restore();
    }
  }

  private changed(): void {
    this.changes.value += 1;
  }
}

// The samples at both ends of a length, and those in an area.
function valuesText({ kind, points }: Measure, slice: Samples): string {
  if (kind === 'length') {
    const ends = points.map(([x, y]): Point => [Math.round(x), Math.round(y)]) as [Point, Point];
    const values = profileOf(slice, ends);
    return [values[0], values.at(-1)].map((value) => exactText(plainValue(value ?? NaN, slice))).join(' to ');
  }
  const found = statisticsIn(slice, points);
  if (!found) return 'no sample inside';
  const { mean, deviation, least, greatest } = found;
  return `mean ${formatValue(mean)}, SD ${formatValue(deviation)}, ${exactText(least)} to ${exactText(greatest)}`;
}

function inPatient(volume: Volume, normal: SlicePlane['normal'], index: number, [column, row]: Point): Vec3 {
  const place: Vec3 = [0, 0, 0];
  const [across, down] = pictureAxes(normal);
  place[axisIndex(normal)] = index;
  place[across] = column;
  place[down] = row;
  return toPatient(volume, place);
}

// On a ground of its own, since slices may be white.
function paintText(context: CanvasRenderingContext2D, text: string, x: number, y: number, ratio: number): void {
  context.font = `600 ${fontSize * ratio}px system-ui, sans-serif`;
  context.textAlign = 'left';
  context.textBaseline = 'middle';
  const width = context.measureText(text).width + 8 * ratio;
  const left = Math.min(x, context.canvas.width - width);
  context.fillStyle = 'rgba(16, 22, 26, 0.8)';
  context.fillRect(left, y - 0.8 * fontSize * ratio, width, 1.6 * fontSize * ratio);
  context.fillStyle = colour;
  context.fillText(text, left + 4 * ratio, y);
}
