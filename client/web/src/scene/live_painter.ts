// The content of a preview, and its painter.
import { Matrix4, Vector3, type PerspectiveCamera } from 'three';
import type { Look } from '../volume/looks';
import { blockSize, type Preview } from '../volume/preview';
import { kinds, type SceneField } from './live_walk';

export interface LiveScene {
  preview: Preview;
  camera: PerspectiveCamera;
  // What the camera looks at, in millimetres.
  target: Vector3;
  // In parts of the preview's window.
  iso: number;
  // The length of a step, in samples; a longer one may pass over what is thinner.
  reach: number;
  // The surface at the iso-value, a look through the samples, or labels by the look's colours.
  kind: keyof typeof kinds;
  look: Look | null;
  // What of the volume is drawn, in parts of its samples along each axis; null for all of it.
  crop: readonly [Vector3, Vector3] | null;
  // Where the slices meet, in millimetres; lines through it are drawn over the surface.
  cursor: Vector3 | null;
}

// In pixels of the screen.
export interface LivePicture {
  // Of the canvas.
  wide: number;
  high: number;
  // Of what is painted, which is enlarged to the canvas.
  width: number;
  height: number;
  // It is painted in so many, and a change ends it after one of them.
  bands: number;
}

export interface LivePainter {
  readonly canvas: HTMLCanvasElement;
  // Software draws.
  readonly isSoftware: boolean;
  // What it paints with is there.
  readonly ready: Promise<void>;
  // Calls back with true when it is on the canvas, with false if `isOver` ended it.
  paint: (scene: LiveScene, picture: LivePicture, isOver: () => boolean, then: (isWhole: boolean) => void) => void;
  // Keeps what it has of these previews, and lets go the others.
  keep: (previews: ReadonlySet<Preview>) => void;
  dispose: () => void;
}

// The colour of the surface, and of the lines over it with their opacity.
const surfaceColour = new Vector3(0.86, 0.84, 0.78);
export const crossColour = '#2ce0cb';
export const crossOpacity = 0.45;

// Where samples of the preview lie in the patient.
export function placeOfSamples({ steps: [x, y, z], origin: [ox, oy, oz] }: Preview): Matrix4 {
  return new Matrix4().set(x[0], y[0], z[0], ox, x[1], y[1], z[1], oy, x[2], y[2], z[2], oz, 0, 0, 0, 1);
}

// Six points, in samples: the ends of three lines through the cursor.
export function crossOf({ preview, cursor }: LiveScene): Float32Array<ArrayBuffer> {
  const points = new Float32Array(18);
  if (!cursor) return points;
  const place = cursor.clone().applyMatrix4(placeOfSamples(preview).invert());
  for (const axis of [0, 1, 2] as const) {
    for (const end of [0, 1]) {
      place.clone().setComponent(axis, end * (preview.dims[axis] - 1)).toArray(points, 3 * (2 * axis + end));
    }
  }
  return points;
}

// The scene as the shader takes it: places in samples, directions as unit vectors in millimetres.
export function valuesOf({ preview, camera, target, iso, reach, kind, look, crop }: LiveScene): Record<SceneField, number | Vector3 | Matrix4> {
  const ofSamples = placeOfSamples(preview);
  const dims = new Vector3(...preview.dims);
  const last = dims.clone().subScalar(1);
  const [low, high] = crop ?? [new Vector3(0, 0, 0), new Vector3(1, 1, 1)];
  return {
    toNormal: ofSamples.clone().setPosition(0, 0, 0).invert().transpose(),
    eye: camera.position.clone().applyMatrix4(ofSamples.clone().invert()),
    iso,
    towardsLight: new Vector3(-0.35, 0.5, 1).transformDirection(camera.matrixWorld),
    reach,
    towardsEye: camera.position.clone().sub(target).normalize(),
    edges: look?.edges ?? 0,
    colour: surfaceColour,
    kind: kinds[kind],
    cropLow: low.clone().multiply(last),
    isCropped: crop ? 1 : 0,
    cropHigh: high.clone().multiply(last),
    blockSize,
    dims,
  };
}

export function isSoftwareName(name: string): boolean {
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
