// Colours for numbers from 0 to 1, each step of which looks as large as any other: along the way the
// lightness, and the hue of a constant chroma, change evenly in OKLab (Björn Ottosson, A perceptual color
// space for image processing, 2020). From a dark violet blue by way of green to a light yellow; dark to
// light as well where hues cannot be told apart.
export type Rgb = [number, number, number]; // 0 to 255, as a screen has them

const from = { lightness: 0.3, hue: 290 };
const to = { lightness: 0.9, hue: 100 };
const chroma = 0.095; // more of it has no place on a screen half-way

// The inverse of OKLab's two matrices, with the cube between them.
function linearOf(lightness: number, a: number, b: number): Rgb {
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
}

// IEC 61966-2-1.
function screenValue(linear: number): number {
  const inside = Math.min(1, Math.max(0, linear));
  const encoded = inside <= 0.0031308 ? 12.92 * inside : 1.055 * inside ** (1 / 2.4) - 0.055;
  return Math.round(255 * encoded);
}

export function colourAt(share: number): Rgb {
  const at = Math.min(1, Math.max(0, share));
  const lightness = from.lightness + at * (to.lightness - from.lightness);
  const hue = ((from.hue + at * (to.hue - from.hue)) * Math.PI) / 180;
  const [red, green, blue] = linearOf(lightness, chroma * Math.cos(hue), chroma * Math.sin(hue));
  return [screenValue(red), screenValue(green), screenValue(blue)];
}

// As many colours at equal steps, red, green, blue and 255.
export function colourTable(count: number): Uint8Array<ArrayBuffer> {
  const table = new Uint8Array(4 * count);
  for (let i = 0; i < count; i += 1) table.set([...colourAt(i / (count - 1)), 255], 4 * i);
  return table;
}

export function cssGradient(stops = 12): string {
  const colours = Array.from({ length: stops }, (_, i) => `rgb(${colourAt(i / (stops - 1)).join(' ')})`);
  return `linear-gradient(to right, ${colours.join(', ')})`;
}
