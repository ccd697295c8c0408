// What the ray-casting shader looks things up in.
import { Data3DTexture, DataTexture, FloatType, LinearFilter, NearestFilter, RedFormat, RGFormat } from 'three';
import { sumsOf, type Look } from '../volume/looks';
import type { Preview } from '../volume/preview';

export interface Drawable {
  preview: Preview;
  samples: Data3DTexture;
  blocks: Data3DTexture;
}

export function drawable(preview: Preview): Drawable {
  const samples = new Data3DTexture(preview.samples, ...preview.dims);
  samples.format = RedFormat;
  samples.minFilter = LinearFilter;
  samples.magFilter = LinearFilter;
  const blocks = new Data3DTexture(preview.blocks, ...preview.blockDims);
  blocks.format = RGFormat;
  blocks.minFilter = NearestFilter;
  blocks.magFilter = NearestFilter;
  for (const texture of [samples, blocks]) {
    texture.unpackAlignment = 1;
    texture.needsUpdate = true;
  }
  return { preview, samples, blocks };
}

export function letGo({ samples, blocks }: Drawable): void {
  samples.dispose();
  blocks.dispose();
}

export function tablesOf(look: Look): { table: DataTexture; sums: DataTexture } {
  const table = new DataTexture(look.table, 256, 1);
  table.minFilter = LinearFilter;
  table.magFilter = LinearFilter;
  const sums = new DataTexture(sumsOf(look), 257, 1, RedFormat, FloatType);
  for (const texture of [table, sums]) texture.needsUpdate = true;
  return { table, sums };
}
