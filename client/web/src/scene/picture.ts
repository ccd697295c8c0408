// A canvas as a PNG without a background, with a scale bar and the key of the colours.
import { formatSize } from '../ui/format';
import { colourAt } from './colour_map';

// The texts over it.
export interface Captions {
  // Pixels for each of the page's, or more.
  scale: number;
  // From top to bottom at the point that the camera looks at, in millimetres.
  seen: number;
  // Below the colours of distances; empty where these are not shown.
  distances: readonly string[];
}

const margin = 14;
const barHeight = 10;

// The longest of 1, 2, 5, 10, 20... millimetres that is not longer.
export function roundLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * ([5, 2].find((factor) => factor * power <= most * (1 + 1e-9)) ?? 1);
}

// As on the page, and still legible where a wide picture is one of two on a sheet.
export function captionScale({ width, height }: Pick<HTMLCanvasElement, 'width' | 'height'>, heightOnPage: number): number {
  return Math.max(height / Math.max(1, heightOnPage), Math.min(width, 2 * height) / 450);
}

// Legible on what is dark and on what is light.
function write(context: CanvasRenderingContext2D, text: string, x: number, y: number): void {
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
}

// In the lower right corner: the cube of directions is in the left one.
function paintCaptions(context: CanvasRenderingContext2D, { scale, seen, distances }: Captions): void {
  const right = context.canvas.width / scale - margin;
  const bottom = context.canvas.height / scale - margin;
  const wide = right / 4;
  context.scale(scale, scale);
  Object.assign(context, { font: '600 12px system-ui, sans-serif', textBaseline: 'bottom', lineJoin: 'round', strokeStyle: '#fff', fillStyle: '#111', lineWidth: 3 });
  const perPixel = (seen * scale) / context.canvas.height;
  const length = roundLength(wide * perPixel);
  const across = length / perPixel;
  context.strokeRect(right - across, bottom - 4, across, 4);
  context.fillRect(right - across, bottom - 4, across, 4);
  context.textAlign = 'right';
  write(context, `${formatSize(length)} mm at the centre`, right, bottom - 8);
  if (distances.length === 0) return;
  const colours = context.createLinearGradient(right - wide, 0, right, 0);
  for (let i = 0; i <= 12; i += 1) colours.addColorStop(i / 12, `rgb(${colourAt(i / 12).join(' ')})`);
  const top = bottom - 72;
  write(context, 'Distance from the scan', right, top - 4);
  context.strokeRect(right - wide, top, wide, barHeight);
  context.fillStyle = colours;
  context.fillRect(right - wide, top, wide, barHeight);
  context.fillStyle = '#111';
  // The first begins at the bar's left end and the last ends at its right one; one between has no room in a narrow picture.
  const ends = [distances[0], distances.length > 1 ? distances.at(-1) : ''];
  ends.forEach((text = '', at) => {
    context.textAlign = at === 0 ? 'left' : 'right';
    write(context, text, at === 0 ? right - wide : right, top + barHeight + 18);
  });
}

export function pictureOf(drawn: HTMLCanvasElement, captions: Captions, paint: (context: CanvasRenderingContext2D) => void): Promise<Blob> {
  const canvas = document.createElement('canvas');
  canvas.width = drawn.width;
  canvas.height = drawn.height;
  const context = canvas.getContext('2d');
  if (!context) return Promise.reject(new Error('The browser does not have enough memory for the picture.'));
  context.drawImage(drawn, 0, 0);
  paint(context);
  paintCaptions(context, captions);
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => {
      if (blob) resolve(blob);
      else reject(new Error('The browser could not make the picture.'));
    }, 'image/png');
  });
}
