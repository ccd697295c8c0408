// A volume with a small bright structure, and how much of it is seen.
import type { Locator } from 'playwright-core';

// Soft tissue of 40 in air of -1000, with an insert of 1200 that is too small for the page's first window. Samples of a millimetre.
export function insertNrrd(size: number): Buffer {
  const samples = new Int16Array(size ** 3);
  const middle = (size - 1) / 2;
  const isNear = (one: number, other: number): boolean => Math.abs(one - other) < 2;
  samples.forEach((_, at) => {
    const [x, y, z] = [at % size, Math.floor(at / size) % size, Math.floor(at / size ** 2)];
    const isInsert = isNear(x, middle + size / 6) && isNear(y, middle) && isNear(z, middle);
    samples[at] = isInsert ? 1200 : Math.hypot(x - middle, y - middle, z - middle) < 0.44 * size ? 40 : -1000;
  });
  const header = `NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: ${size} ${size} ${size}\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nendian: little\nencoding: raw\n\n`;
  return Buffer.concat([Buffer.from(header), Buffer.from(samples.buffer)]);
}

// White pixels in the middle of a slice or a plane, without the letters at its edges.
export function whitePixels(canvas: Locator): Promise<number> {
  return canvas.evaluate((one: HTMLCanvasElement) => {
    const edge = 30;
    const { data = [] } = one.getContext('2d', { willReadFrequently: true })?.getImageData(edge, edge, one.width - 2 * edge, one.height - 2 * edge) ?? {};
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (Math.min(data[i] ?? 0, data[i + 1] ?? 0, data[i + 2] ?? 0) > 230) count += 1;
    return count;
  });
}
