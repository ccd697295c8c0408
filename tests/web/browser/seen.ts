// Looks at the page's pictures.
import type { JSHandle, Locator, Page } from 'playwright-core';

// Pixels of a slice that have the contour's colour.
export function contourPixels(page: Page, plane: string): Promise<number> {
  return page.evaluate((name) => {
    const canvas = document.querySelector<HTMLCanvasElement>(`[data-plane=${name}] canvas`);
    const pixels = canvas?.getContext('2d')?.getImageData(0, 0, canvas.width, canvas.height).data ?? [];
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) {
      // Grey has equal parts; the contour is green and blue.
      if ((pixels[i + 1] ?? 0) - (pixels[i] ?? 0) > 60) count += 1;
    }
    return count;
  }, plane);
}

export interface Silhouette {
  // The part of the picture that differs from its background.
  part: number;
  // The box around what differs, in parts of the picture.
  width: number;
  height: number;
  // The part of that box that differs.
  filling: number;
  // Distinct colours in it: a flat patch has one.
  colours: number;
}

export interface Hues {
  red: number;
  green: number;
  blue: number;
}

// A PNG's pixels, in the page.
export function pixelsOf(page: Page, picture: Buffer): Promise<JSHandle<ImageData>> {
  return page.evaluateHandle(async (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const canvas = document.createElement('canvas');
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
    const context = canvas.getContext('2d');
    if (!context) throw new Error('no canvas');
    context.drawImage(bitmap, 0, 0);
    return context.getImageData(0, 0, bitmap.width, bitmap.height);
  }, picture.toString('base64'));
}

// The pixels of a view, without the tools over it.
async function pixelsOfView(page: Page, element: Locator): Promise<JSHandle<ImageData>> {
  const showTools = (visibility: string): Promise<void> =>
    page.locator('.tools, .legend').evaluateAll((all, value) => {
      for (const tools of all as HTMLElement[]) tools.style.visibility = value;
    }, visibility);
  await showTools('hidden');
  const picture = await element.screenshot();
  await showTools('');
  return pixelsOf(page, picture);
}

// Pixels of a view, without the tools over it, that are clearly of one of these hues.
export async function hues(page: Page, element: Locator): Promise<Hues> {
  const pixels = await pixelsOfView(page, element);
  return pixels.evaluate(({ data }) => {
    const count = { red: 0, green: 0, blue: 0 };
    const clear = 60;
    for (let at = 0; at < data.length; at += 4) {
      const [red = 0, green = 0, blue = 0] = data.subarray(at, at + 3);
      if (red > Math.max(green, blue) + clear) count.red += 1;
      if (green > Math.max(red, blue) + clear) count.green += 1;
      if (blue > Math.max(red, green) + clear) count.blue += 1;
    }
    return count;
  });
}

// The outline of all that stands out in a picture of a view, without the tools over it.
export async function silhouette(page: Page, element: Locator, tolerance = 24): Promise<Silhouette> {
  const pixels = await pixelsOfView(page, element);
  return pixels.evaluate(({ data, width: across, height: down }, most) => {
    const corner = 116; // the orientation cube
    const seen = { count: 0, left: Infinity, right: -1, top: Infinity, bottom: -1 };
    const colours = new Set<number>();
    for (let y = 0; y < down; y += 1) {
      // The background is a gradient from top to bottom, so that every row has its own.
      const edge = 4 * (y * across + across - 3);
      for (let x = 0; x < across; x += 1) {
        if (x < corner && y > down - corner) continue;
        const at = 4 * (y * across + x);
        const difference =
          Math.abs((data[at] ?? 0) - (data[edge] ?? 0)) +
          Math.abs((data[at + 1] ?? 0) - (data[edge + 1] ?? 0)) +
          Math.abs((data[at + 2] ?? 0) - (data[edge + 2] ?? 0));
        if (difference <= most) continue;
        seen.count += 1;
        seen.left = Math.min(seen.left, x);
        seen.right = Math.max(seen.right, x);
        seen.top = Math.min(seen.top, y);
        seen.bottom = Math.max(seen.bottom, y);
        colours.add(((data[at] ?? 0) << 16) | ((data[at + 1] ?? 0) << 8) | (data[at + 2] ?? 0));
      }
    }
    const width = Math.max(0, seen.right - seen.left + 1);
    const height = Math.max(0, seen.bottom - seen.top + 1);
    return {
      part: seen.count / (across * down),
      width: width / across,
      height: height / down,
      filling: seen.count / Math.max(1, width * height),
      colours: colours.size,
    };
  }, tolerance);
}
