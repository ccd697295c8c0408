// Pictures as small PNG files: at most 256 colours, one byte a pixel.
import { deflateSync } from 'node:zlib';

const mostColours = 256;

const crcTable = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit += 1) value = value & 1 ? (value >>> 1) ^ 0xedb8_8320 : value >>> 1;
  return value >>> 0;
});

function crc(bytes: Buffer): number {
  const rest = bytes.reduce((value, byte) => (crcTable[(value ^ byte) & 0xff] ?? 0) ^ (value >>> 8), 0xffff_ffff);
  return (rest ^ 0xffff_ffff) >>> 0;
}

function chunk(name: string, data: Buffer): Buffer {
  const body = Buffer.concat([Buffer.from(name, 'latin1'), data]);
  const length = Buffer.alloc(4);
  length.writeUInt32BE(data.length);
  const check = Buffer.alloc(4);
  check.writeUInt32BE(crc(body));
  return Buffer.concat([length, body, check]);
}

const part = (colour: number, shift: number): number => (colour >> shift) & 0xff;

function distance(a: number, b: number): number {
  return [0, 8, 16].reduce((sum, shift) => sum + (part(a, shift) - part(b, shift)) ** 2, 0);
}

// The most frequent colours, and the one of them that is nearest to each colour.
function palette(pixels: Uint32Array): { colours: number[]; places: Map<number, number> } {
  const counts = new Map<number, number>();
  for (const pixel of pixels) counts.set(pixel & 0xff_ffff, (counts.get(pixel & 0xff_ffff) ?? 0) + 1);
  const byCount = [...counts].sort((a, b) => b[1] - a[1]).map(([colour]) => colour);
  // Not only the frequent ones: a rare colour far from all others would be lost.
  const colours: number[] = [];
  for (const least of [300, 60, 0]) {
    for (const colour of byCount) {
      if (colours.length === mostColours) break;
      if (colours.every((known) => distance(known, colour) > least)) colours.push(colour);
    }
  }
  const places = new Map<number, number>();
  for (const colour of byCount) {
    let nearest = 0;
    colours.forEach((known, place) => {
      if (distance(known, colour) < distance(colours[nearest] ?? 0, colour)) nearest = place;
    });
    places.set(colour, nearest);
  }
  return { colours, places };
}

// From rows of red, green, blue and opacity.
export function encodePng(width: number, height: number, rgba: Uint8Array): Buffer {
  const pixels = new Uint32Array(rgba.buffer, rgba.byteOffset, width * height);
  const { colours, places } = palette(pixels);
  const rows = Buffer.alloc((width + 1) * height);
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) {
      rows[y * (width + 1) + 1 + x] = places.get((pixels[y * width + x] ?? 0) & 0xff_ffff) ?? 0;
    }
  }
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 3, 0, 0, 0], 8);
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]),
    chunk('IHDR', header),
    chunk('PLTE', Buffer.from(colours.flatMap((colour) => [0, 8, 16].map((shift) => part(colour, shift))))),
    chunk('IDAT', deflateSync(rows, { level: 9 })),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}
