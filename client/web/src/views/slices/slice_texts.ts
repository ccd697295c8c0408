// Texts for the address about slices: slab, plane and measurements.
import type { Plane } from '../../volume/geometry';
import { pointsOf, type MeasureKind } from '../../volume/measure';
import type { Angles } from '../../volume/oblique';
import type { Projection, Slab } from '../../volume/reslice';

export const thicknesses: readonly number[] = [5, 10, 20, 40]; // mm
const projections: readonly Projection[] = ['maximum', 'mean'];
const planes: readonly Plane[] = ['axial', 'coronal', 'sagittal'];
const mostMeasures = 32;
const degrees = 180 / Math.PI;

// Columns and rows of a slice's picture, from the middle of its first sample.
export type Point = readonly [number, number];

export interface Measure {
  kind: MeasureKind;
  plane: Plane;
  // The slice that it lies in.
  index: number;
  points: Point[];
  isWhole: boolean;
}

// maximum-10; '' for none.
export function slabToText(slab: Slab | null): string {
  return slab ? `${slab.projection}-${slab.thickness}` : '';
}

export function slabOfText(text: string): Slab | null {
  const [name, length] = text.split('-');
  const projection = projections.find((one) => one === name);
  const thickness = thicknesses.find((one) => String(one) === length);
  return projection && thickness !== undefined ? { projection, thickness } : null;
}

// Turn and tilt in degrees.
export function anglesToText({ turn, tilt }: Angles): string {
  return [turn, tilt].map((angle) => Number((angle * degrees).toFixed(1))).join(',');
}

export function anglesOfText(text: string): Angles | null {
  const [turn, tilt, ...more] = text.split(',').map(Number);
  const isAngle = (angle: number | undefined): angle is number => angle !== undefined && Math.abs(angle) <= 90;
  return more.length === 0 && isAngle(turn) && isAngle(tilt) ? { turn: turn / degrees, tilt: tilt / degrees } : null;
}

// For each that is whole its kind, plane, slice, and the columns and rows of its points: length,axial,24,10.5,24,30.5,24
export function measuresToText(measures: readonly Measure[]): string {
  return measures
    .filter(({ isWhole }) => isWhole)
    .map(({ kind, plane, index, points }) => [kind, plane, index, ...points.flat().map((value) => Number(value.toFixed(3)))].join(','))
    .join(';');
}

export function measuresOfText(text: string): Measure[] {
  return text
    .split(';')
    .slice(0, mostMeasures)
    .flatMap((one) => {
      const [kindName, planeName, ...texts] = one.split(',');
      const kind = (Object.keys(pointsOf) as MeasureKind[]).find((known) => known === kindName);
      const plane = planes.find((known) => known === planeName);
      const [index = NaN, ...numbers] = texts.map(Number);
      const points = Array.from({ length: numbers.length / 2 }, (_, at): Point => [numbers[2 * at] as number, numbers[2 * at + 1] as number]);
      const isRight = kind === 'area' ? points.length >= 3 : kind && points.length === pointsOf[kind];
      const areNumbers = Number.isInteger(index) && numbers.length % 2 === 0 && numbers.every(Number.isFinite);
      return kind && plane && isRight && areNumbers ? [{ kind, plane, index, points, isWhole: true }] : [];
    });
}
