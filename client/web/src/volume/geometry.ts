// Where samples lie in the patient (LPS millimetres), and how slices are turned for the eye.
import type { Axis, Vec3, Volume } from '../api/types';

interface Directed {
  direction: readonly number[];
}
type Geometry = Pick<Volume, 'dims' | 'spacing' | 'origin'> & Directed;

export const axes: readonly Axis[] = ['x', 'y', 'z'];

export function axisIndex(axis: Axis): 0 | 1 | 2 {
  return axis === 'x' ? 0 : axis === 'y' ? 1 : 2;
}

// The unit vector of a volume's axis in LPS.
export function axisDirection(volume: Directed, axis: number): Vec3 {
  const at = (row: number): number => volume.direction[3 * row + axis] ?? (row === axis ? 1 : 0);
  return [at(0), at(1), at(2)];
}

export function toPatient(volume: Geometry, index: Vec3): Vec3 {
  const point: Vec3 = [...volume.origin];
  for (let axis = 0; axis < 3; axis += 1) {
    const direction = axisDirection(volume, axis);
    const step = index[axis as 0] * volume.spacing[axis as 0];
    for (let row = 0; row < 3; row += 1) point[row as 0] += direction[row as 0] * step;
  }
  return point;
}

// Where a point of the patient lies, in samples, which may be parts of one.
export function toSamples(volume: Geometry, point: Vec3): Vec3 {
  const [a, b, c] = ([0, 1, 2] as const).map((axis) =>
    axisDirection(volume, axis).map((value) => value * volume.spacing[axis]),
  ) as [Vec3, Vec3, Vec3];
  const from = point.map((value, axis) => value - volume.origin[axis as 0]) as Vec3;
  // Cramer's rule.
  const volumeOf = dot(a, cross(b, c));
  return [dot(from, cross(b, c)) / volumeOf, dot(a, cross(from, c)) / volumeOf, dot(a, cross(b, from)) / volumeOf];
}

// The nearest sample of the volume.
export function sampleAt(volume: Geometry, point: Vec3): Vec3 {
  return toSamples(volume, point).map((value, axis) =>
    Math.max(0, Math.min(volume.dims[axis as 0] - 1, Math.round(value))),
  ) as Vec3;
}

const letters: readonly [string, string][] = [
  ['L', 'R'],
  ['P', 'A'],
  ['S', 'I'],
];

// The letter of the patient's side that a vector points to most.
export function sideOf(vector: Vec3): string {
  const sizes = vector.map(Math.abs);
  const main = sizes.indexOf(Math.max(...sizes));
  const pair = letters[main] ?? ['?', '?'];
  return (vector[main as 0] ?? 0) >= 0 ? pair[0] : pair[1];
}

export type Plane = 'axial' | 'coronal' | 'sagittal';

// The patient's axis (of L, P, S) that a plane is across.
const normals: Record<Plane, 0 | 1 | 2> = { sagittal: 0, coronal: 1, axial: 2 };
// What points right and down on the screen, as radiologists look: the patient's right on the left,
// the front at the top or left, the head at the top.
const screens: Record<Plane, { right: Vec3; down: Vec3 }> = {
  axial: { right: [1, 0, 0], down: [0, 1, 0] },
  coronal: { right: [1, 0, 0], down: [0, 0, -1] },
  sagittal: { right: [0, 1, 0], down: [0, 0, -1] },
};

export interface SliceAxis {
  axis: Axis;
  // True when the volume's index runs against the screen's direction.
  flipped: boolean;
  // The letters at both of its ends on the screen.
  begin: string;
  end: string;
}

export interface SlicePlane {
  plane: Plane;
  normal: Axis;
  right: SliceAxis;
  down: SliceAxis;
}

export function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function opposite(vector: Vec3): Vec3 {
  return [-vector[0], -vector[1], -vector[2]];
}

// Which volume axis runs most along each of the patient's: the best of the six assignments, so that
// no axis is taken twice however oblique the volume lies.
export function patientAxes(volume: Directed): [Axis, Axis, Axis] {
  const orders = [
    [0, 1, 2],
    [0, 2, 1],
    [1, 0, 2],
    [1, 2, 0],
    [2, 0, 1],
    [2, 1, 0],
  ];
  const fit = (order: number[]): number =>
    order.reduce((sum, axis, row) => sum + Math.abs(axisDirection(volume, axis)[row as 0]), 0);
  const best = orders.reduce((a, b) => (fit(b) > fit(a) + 1e-9 ? b : a));
  return best.map((axis) => axes[axis]) as [Axis, Axis, Axis];
}

export function slicePlane(volume: Directed, plane: Plane): SlicePlane {
  const along = patientAxes(volume);
  const { right, down } = screens[plane];
  const rowOf = (vector: Vec3): 0 | 1 | 2 => vector.findIndex((value) => value !== 0) as 0;
  const sliceAxis = (screen: Vec3): SliceAxis => {
    const axis = along[rowOf(screen)];
    const direction = axisDirection(volume, axisIndex(axis));
    const flipped = dot(direction, screen) < 0;
    const towards = flipped ? opposite(direction) : direction;
    return { axis, flipped, begin: sideOf(opposite(towards)), end: sideOf(towards) };
  };
  return { plane, normal: along[normals[plane]], right: sliceAxis(right), down: sliceAxis(down) };
}

// A volume's axes with its patient's sides exchanged along L, P or S, in the order that the server takes.
export function flipped(volume: Directed, patientAxis: 0 | 1 | 2): string {
  const axis = patientAxes(volume)[patientAxis];
  return axes.map((each) => (each === axis ? `-${each}` : each)).join();
}

// The right of a slice becomes its bottom.
export function turned(volume: Directed, plane: Plane): string {
  const { right, down } = slicePlane(volume, plane);
  const order: string[] = [...axes];
  const isOpposite = right.flipped !== down.flipped;
  order[axisIndex(right.axis)] = `${isOpposite ? '-' : ''}${down.axis}`;
  order[axisIndex(down.axis)] = `${isOpposite ? '' : '-'}${right.axis}`;
  return order.join();
}

// The two axes of a slice's picture: its columns run along the first, its rows along the second.
export function pictureAxes(normal: Axis): [0 | 1 | 2, 0 | 1 | 2] {
  return normal === 'x' ? [1, 2] : normal === 'y' ? [0, 2] : [0, 1];
}

// a, b, c, d, e, f as a canvas takes them: x = a u + c v + e, y = b u + d v + f.
export type Placement = [number, number, number, number, number, number];

export interface Room {
  width: number;
  height: number;
  // Left free on every side.
  edge: number;
}

// Where a slice's picture lies in the room, as large as it fits, in true proportions: u and v count the
// picture's columns and rows, whose samples are one wide. A volume whose axes are not at right angles (a tilted
// gantry) gives a parallelogram, with its axis of the screen's right level.
export function slicePlacement(volume: Geometry, { normal, right, down }: SlicePlane, room: Room): Placement {
  const towards = ({ axis, flipped }: SliceAxis): Vec3 => {
    const direction = axisDirection(volume, axisIndex(axis));
    return flipped ? opposite(direction) : direction;
  };
  const cosine = dot(towards(right), towards(down));
  const lean = Math.abs(cosine) < 1e-6 ? 0 : cosine;
  const screenOf = (axis: 0 | 1 | 2): [number, number] => {
    const isAcross = axisIndex(right.axis) === axis;
    const { flipped } = isAcross ? right : down;
    const step = volume.spacing[axis] * (flipped ? -1 : 1);
    return isAcross ? [step, 0] : [step * lean, step * Math.sqrt(1 - lean * lean)];
  };
  const [columns, rows] = pictureAxes(normal);
  const u = screenOf(columns);
  const v = screenOf(rows);
  const size = ([du, dv]: [number, number], at: 0 | 1): number => du * u[at] + dv * v[at];
  const corners: [number, number][] = [
    [0, 0],
    [volume.dims[columns], 0],
    [0, volume.dims[rows]],
    [volume.dims[columns], volume.dims[rows]],
  ];
  const low = ([0, 1] as const).map((at) => Math.min(...corners.map((corner) => size(corner, at)))) as [number, number];
  const high = ([0, 1] as const).map((at) => Math.max(...corners.map((corner) => size(corner, at)))) as [number, number];
  const scale = Math.max(
    1e-9,
    Math.min(
      (room.width - 2 * room.edge) / (high[0] - low[0]),
      (room.height - 2 * room.edge) / (high[1] - low[1]),
    ),
  );
  return [
    u[0] * scale,
    u[1] * scale,
    v[0] * scale,
    v[1] * scale,
    (room.width - scale * (high[0] + low[0])) / 2,
    (room.height - scale * (high[1] + low[1])) / 2,
  ];
}

// Which column and row of the picture lie at a point.
export function placedAt([a, b, c, d, e, f]: Placement, x: number, y: number): [number, number] {
  const determinant = a * d - b * c;
  return [(d * (x - e) - c * (y - f)) / determinant, (a * (y - f) - b * (x - e)) / determinant];
}

// A sample as an address names it; of each axis that is none of the volume's, the middle.
export function cursorOfText(text: string, volume: Pick<Volume, 'dims'>): Vec3 {
  const middle = volume.dims.map((count) => Math.floor(count / 2)) as Vec3;
  const given = text.split(',').map(Number);
  return middle.map((value, axis) => {
    const wanted = given.length === 3 ? given[axis] : undefined;
    const isThere = Number.isInteger(wanted) && (wanted as number) >= 0 && (wanted as number) < volume.dims[axis as 0];
    return isThere ? (wanted as number) : value;
  }) as Vec3;
}
