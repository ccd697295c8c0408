// The box that a job is cropped to: in the request two corners in millimetres, on the slices samples.
import type { JobParameters, Vec3, Volume } from '../api/types';
import { axisDirection, toPatient, toSamples } from './geometry';

// The first and the last sample along each axis.
export type Box = [Vec3, Vec3];

type Placed = Pick<Volume, 'dims' | 'spacing' | 'origin' | 'direction'>;

// True if the volume's axes are the patient's axes, so that a box is a box in both.
export function isUpright(volume: Pick<Volume, 'direction'>): boolean {
  return [0, 1, 2].every((axis) => axisDirection(volume, axis).some((value) => Math.abs(value) > 1 - 1e-6));
}

export function wholeBox({ dims }: Pick<Volume, 'dims'>): Box {
  return [[0, 0, 0], dims.map((count) => count - 1) as Vec3];
}

export function boxOf(volume: Placed, crop: JobParameters['crop']): Box | null {
  if (!crop || crop.length !== 2) return null;
  const [one, other] = (crop as unknown as Box).map((corner) => toSamples(volume, corner)) as Box;
  const low = one.map((value, axis) => Math.ceil(Math.min(value, other[axis as 0]) - 1e-6)) as Vec3;
  const high = one.map((value, axis) => Math.floor(Math.max(value, other[axis as 0]) + 1e-6)) as Vec3;
  return within(volume, [low, high]);
}

export function cropOf(volume: Placed, [low, high]: Box): NonNullable<JobParameters['crop']> {
  const [one, other] = [toPatient(volume, low), toPatient(volume, high)];
  // Not so short that a sample at the border is left out.
  const rounded = (value: number): number => Number(value.toFixed(6));
  const corners: Box = [
    one.map((value, axis) => rounded(Math.min(value, other[axis as 0]))) as Vec3,
    one.map((value, axis) => rounded(Math.max(value, other[axis as 0]))) as Vec3,
  ];
  // The generator takes the count of corners for one of their own.
  return corners as unknown as NonNullable<JobParameters['crop']>;
}

// In the volume, with two samples at least along each axis that has them.
export function within({ dims }: Pick<Volume, 'dims'>, [low, high]: Box): Box {
  const last = dims.map((count) => count - 1) as Vec3;
  const begin = low.map((value, axis) => Math.max(0, Math.min(Math.max(0, last[axis as 0] - 1), Math.round(value)))) as Vec3;
  const end = high.map((value, axis) =>
    Math.min(last[axis as 0], Math.max(begin[axis as 0] + 1, Math.round(value))),
  ) as Vec3;
  return [begin, end];
}
