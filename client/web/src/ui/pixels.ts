// Pictures of eight bits, as canvases take them.

// For each value its pixel: opaque, then blue, green and red.
export const greys = Uint32Array.from({ length: 256 }, (_, grey) => (0xff00_0000 | (grey * 0x01_0101)) >>> 0);

export interface Values {
  width: number;
  height: number;
  values: ArrayLike<number>;
}

export function imageOf({ width, height, values }: Values, pixels: Uint32Array): ImageData {
  const image = new ImageData(width, height);
  const into = new Uint32Array(image.data.buffer);
  for (let at = 0; at < into.length; at += 1) into[at] = pixels[values[at] as number] ?? 0;
  return image;
}

// With its own size.
export function paintImage(canvas: HTMLCanvasElement, image: ImageData): void {
  [canvas.width, canvas.height] = [image.width, image.height];
  canvas.getContext('2d', { willReadFrequently: true })?.putImageData(image, 0, 0);
}
