// Pictures of the volumes in a NIfTI file of several, so that a person can choose one before the daemon reads it: the middle slice
// of each. Reads the file from its beginning on and keeps no more of it than these.

export interface Picture {
  width: number;
  height: number;
  grey: Uint8ClampedArray;
}

const headBytes = 1024;
const mostSide = 160;
// As many as the daemon offers.
const mostVolumes = 1000;

interface NiftiHead {
  dims: number[];
  // Where the samples begin.
  begin: number;
  // NIfTI's code of their type, and their bits.
  type: number;
  bits: number;
  isLittle: boolean;
  isElsewhere: boolean;
}

// Of the first bytes of a NIfTI file, as they are when nothing is compressed. Null where they tell nothing.
function niftiHead(head: Uint8Array): NiftiHead | null {
  if (head.length < 352) return null;
  const view = new DataView(head.buffer, head.byteOffset, head.byteLength);
  const isLittle = [348, 540].includes(view.getInt32(0, true));
  const version = view.getInt32(0, isLittle);
  const isSecond = version === 540;
  if (![348, 540].includes(version) || head.length < version) return null;
  const magic = String.fromCharCode(...head.subarray(isSecond ? 4 : 344, isSecond ? 7 : 347));
  const dimAt = (at: number): number =>
    isSecond ? Number(view.getBigInt64(16 + 8 * at, isLittle)) : view.getInt16(40 + 2 * at, isLittle);
  const count = dimAt(0);
  if (!(count >= 1 && count <= 7)) return null;
  const dims = Array.from({ length: count }, (_, at) => dimAt(at + 1));
  if (!dims.every((one) => one > 0)) return null;
  return {
    dims,
    begin: isSecond ? Number(view.getBigInt64(168, isLittle)) : view.getFloat32(108, isLittle),
    type: view.getInt16(isSecond ? 12 : 70, isLittle),
    bits: view.getInt16(isSecond ? 14 : 72, isLittle),
    isLittle,
    isElsewhere: !magic.startsWith('n+'),
  };
}

type Read = (view: DataView, at: number, isLittle: boolean) => number;

// By NIfTI's codes.
const readers: Readonly<Record<number, Read>> = {
  2: (view, at) => view.getUint8(at),
  4: (view, at, isLittle) => view.getInt16(at, isLittle),
  8: (view, at, isLittle) => view.getInt32(at, isLittle),
  16: (view, at, isLittle) => view.getFloat32(at, isLittle),
  64: (view, at, isLittle) => view.getFloat64(at, isLittle),
  256: (view, at) => view.getInt8(at),
  512: (view, at, isLittle) => view.getUint16(at, isLittle),
  768: (view, at, isLittle) => view.getUint32(at, isLittle),
};

// Bytes of a file, also of one that was compressed by gzip; each call from where the one before ended, or behind it.
class Forwards {
  private at = 0;
  private rest: Uint8Array = new Uint8Array(0);
  private readonly reader: ReadableStreamDefaultReader<Uint8Array>;

  constructor(stream: ReadableStream<Uint8Array>) {
    this.reader = stream.getReader();
  }

  // Fewer where the file ends.
  async read(from: number, to: number): Promise<Uint8Array> {
    const found = new Uint8Array(to - from);
    for (;;) {
      this.advance(Math.max(0, from - this.at));
      if (this.at >= from) {
        found.set(this.rest.subarray(0, to - this.at), this.at - from);
        this.advance(to - this.at);
      }
      if (this.at >= to) return found;
      const { done, value } = await this.reader.read();
      if (done) return found.subarray(0, Math.max(0, this.at - from));
      this.rest = value;
    }
  }

  private advance(bytes: number): void {
    const skipped = Math.min(bytes, this.rest.length);
    this.at += skipped;
    this.rest = this.rest.subarray(skipped);
  }

  async cancel(): Promise<void> {
    await this.reader.cancel();
  }
}

async function opened(file: Blob): Promise<Forwards> {
  const [first, second] = new Uint8Array(await file.slice(0, 2).arrayBuffer());
  const isPacked = first === 0x1f && second === 0x8b;
  const stream = file.stream();
  return new Forwards(isPacked ? stream.pipeThrough(new DecompressionStream('gzip')) : stream);
}

// Every so many samples of a slice, from the last row to the first: rows run to the front of most heads.
function valuesOf(bytes: Uint8Array, { dims: [width = 1, height = 1], bits, isLittle }: NiftiHead, read: Read): { width: number; height: number; values: Float64Array } {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const step = Math.ceil(Math.max(width, height) / mostSide);
  const [across, down] = [Math.ceil(width / step), Math.ceil(height / step)];
  const values = new Float64Array(across * down);
  for (let row = 0; row < down; row += 1) {
    for (let column = 0; column < across; column += 1) {
      const at = (down - 1 - row) * step * width + column * step;
      values[row * across + column] = read(view, (at * bits) / 8, isLittle);
    }
  }
  return { width: across, height: down, values };
}

// Calls back with a picture of each volume, one after the other, all by the window of the first. Nothing where the file is none that
// is read here.
export async function readTimePoints(file: Blob, onPicture: (index: number, picture: Picture) => void, signal: AbortSignal): Promise<void> {
  const bytes = await opened(file);
  try {
    const head = niftiHead(await bytes.read(0, headBytes));
    const read = head && readers[head.type];
    // From its beginning again, as the samples may begin within the first bytes.
    if (!head || !read || head.isElsewhere) return;
    await readFrames(await opened(file), head, read, onPicture, signal);
  } finally {
    await bytes.cancel();
  }
}

async function readFrames(bytes: Forwards, head: NiftiHead, read: Read, onPicture: (index: number, picture: Picture) => void, signal: AbortSignal): Promise<void> {
  const [width = 1, height = 1, depth = 1, ...others] = head.dims;
  const sliceBytes = (width * height * head.bits) / 8;
  const count = Math.min(mostVolumes, others.reduce((product, one) => product * one, 1));
  let window: readonly [number, number] | null = null;
  for (let index = 0; index < count && !signal.aborted; index += 1) {
    const from = head.begin + (index * depth + Math.floor(depth / 2)) * sliceBytes;
    const slice = await bytes.read(from, from + sliceBytes);
    if (slice.length < sliceBytes) break;
    const { values, ...size } = valuesOf(slice, head, read);
    window ??= windowOf(values);
    const [low, high] = window;
    onPicture(index, { ...size, grey: Uint8ClampedArray.from(values, (value) => (255 * (value - low)) / (high - low || 1)) });
  }
  await bytes.cancel();
}

function windowOf(values: Float64Array): readonly [number, number] {
  const sorted = values.filter(Number.isFinite).sort();
  const at = (part: number): number => sorted[Math.floor(part * (sorted.length - 1))] ?? 0;
  return [at(0.02), at(0.99)];
}
