// Slices of a volume as samples: fetched as pictures of 8 bits over a window, kept while they are near.
import { client } from '../client';
import type { Axis, Volume } from '../api/types';
import { shortened } from '../ui/format';
import type { Scope } from '../ui/signal';
import { ExactSamples } from './exact';
import type { LabelMap } from './label_map';
import { Nearby } from './nearby';

export type Window = [number, number];

// A slice's samples, of which 0 and 255 are the ends of its window.
export interface Slice {
  axis: Axis;
  index: number;
  width: number;
  height: number;
  values: Uint8Array;
  window: Window;
  // Of a segmentation: the numbers of the labels in their map.
  labels?: Uint16Array;
}

const mostSlices = 96;

async function grey(picture: Blob): Promise<{ width: number; height: number; values: Uint8Array }> {
  const bitmap = await createImageBitmap(picture, { colorSpaceConversion: 'none' });
  const { width, height } = bitmap;
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d', { willReadFrequently: true });
  if (!context) throw new Error('The browser does not have enough memory for the slice.');
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  const pixels = context.getImageData(0, 0, width, height).data;
  const values = new Uint8Array(width * height);
  for (let i = 0; i < values.length; i += 1) values[i] = pixels[4 * i] ?? 0;
  return { width, height, values };
}

export function sliceKey(axis: Axis, index: number, window: Window, map: LabelMap | null = null): string {
  return `${axis}/${index}/${map ? map.key : window.join(',')}`;
}

export class SliceSource {
  readonly exact: ExactSamples;
  private readonly slices = new Nearby<Slice>(mostSlices);

  constructor(
    private readonly volume: Volume,
    private readonly scope: Scope,
  ) {
    this.exact = new ExactSamples(volume, scope);
  }

  // The slice if it is here already.
  find(axis: Axis, index: number, window: Window, map: LabelMap | null = null): Slice | null {
    return this.slices.find(sliceKey(axis, index, window, map));
  }

  // With a map the slice has the numbers of its labels, and its window is the first of the map's.
  get(axis: Axis, index: number, window: Window, map: LabelMap | null = null): Promise<Slice> {
    return this.slices.get(sliceKey(axis, index, window, map), () => (map ? this.fetchLabels(axis, index, map) : this.fetch(axis, index, window)));
  }

  private async fetch(axis: Axis, index: number, window: Window): Promise<Slice> {
    const samples = await grey(await client.slicePicture(this.volume.id, axis, index, window, this.scope.signal));
    return { axis, index, window, ...samples };
  }

  private async fetchLabels(axis: Axis, index: number, map: LabelMap): Promise<Slice> {
    const pictures = await Promise.all(map.windows.map((window) => this.fetch(axis, index, window)));
    const [first] = pictures;
    if (!first) throw new Error('There are no labels.');
    const labels = new Uint16Array(first.values.length);
    for (const { values, window } of pictures) map.take(values, window, labels);
    return { ...first, labels };
  }
}

// The window to fetch so that both the window shown and the contour at the iso-value are precise: the
// common one while it is not much wider than what is looked at, else a narrower one.
export function windowToFetch(shown: Window, iso: number, common: Window): Window {
  const margin = 0.02 * (common[1] - common[0]);
  const low = Math.min(shown[0], iso - margin);
  const high = Math.max(shown[1], iso + margin);
  const covered = low >= common[0] && high <= common[1];
  if (covered && common[1] - common[0] <= 4 * (high - low)) return common;
  return [shortened(low, high - low), shortened(high, high - low)];
}

export function textOfWindow([low, high]: Window): string {
  return [low, high].map((value) => shortened(value, high - low, 5)).join(',');
}

// As an address says it; null if it does not.
export function windowOfText(text: string): Window | null {
  const [low, high] = text.split(',').map(Number);
  return low !== undefined && high !== undefined && high > low ? [low, high] : null;
}

// For each value of a slice the grey of a window.
export function greyTable(slice: Pick<Slice, 'window'>, shown: Window): Uint8ClampedArray {
  const table = new Uint8ClampedArray(256);
  const [low, high] = slice.window;
  const width = shown[1] - shown[0] || 1;
  for (let value = 0; value < 256; value += 1) {
    const sample = low + (value / 255) * (high - low);
    table[value] = (255 * (sample - shown[0])) / width;
  }
  return table;
}

// An iso-value in the units of a slice's values.
export function inSlice(slice: Pick<Slice, 'window'>, iso: number): number {
  const [low, high] = slice.window;
  return (255 * (iso - low)) / (high - low || 1);
}

// As on a radiologist's station: to the right widens the window, upwards darkens (raises its level).
export function draggedWindow([low, high]: Window, dx: number, dy: number): Window {
  const width = Math.max(1e-6, high - low);
  const level = (low + high) / 2;
  const newWidth = width * Math.exp(dx / 250);
  const newLevel = level - (dy / 400) * width;
  return [newLevel - newWidth / 2, newLevel + newWidth / 2];
}
