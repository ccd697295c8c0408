// Looks into DICOM files that are to be uploaded, so that a person can tell series apart: their dates and a picture. What
// cannot be read here (compressed, big-endian, not DICOM) has neither; the daemon decides what a file is.

export interface Peek {
  series: string;
  // YYYY-MM-DD; '' if the file has none.
  date: string;
  picture: { width: number; height: number; grey: Uint8ClampedArray } | null;
}

const explicitLittle = ['1.2.840.10008.1.2.1'];
const implicitLittle = '1.2.840.10008.1.2';
const longKinds = ['OB', 'OD', 'OF', 'OL', 'OV', 'OW', 'SQ', 'SV', 'UC', 'UN', 'UR', 'UT', 'UV'];
const undefinedLength = 0xffff_ffff;
const mostDepth = 8;

interface Element {
  tag: number;
  kind: string;
  // Where its value begins, and how long it is.
  at: number;
  length: number;
}

class Reader {
  constructor(
    readonly view: DataView,
    public at: number,
    public isExplicit: boolean,
  ) {}

  get isOver(): boolean {
    return this.at + 8 > this.view.byteLength;
  }

  peekGroup(): number {
    return this.view.getUint16(this.at, true);
  }

  // The next element; reading goes on at its value. Throws RangeError where the file ends.
  next(): Element {
    const { view, at } = this;
    const tag = view.getUint16(at, true) * 0x1_0000 + view.getUint16(at + 2, true);
    const isItem = Math.floor(tag / 0x1_0000) === 0xfffe;
    if (isItem || !this.isExplicit) {
      this.at += 8;
      return { tag, kind: '', at: this.at, length: view.getUint32(at + 4, true) };
    }
    const kind = String.fromCharCode(view.getUint8(at + 4), view.getUint8(at + 5));
    const isLong = longKinds.includes(kind);
    this.at += isLong ? 12 : 8;
    return { tag, kind, at: this.at, length: isLong ? view.getUint32(at + 8, true) : view.getUint16(at + 6, true) };
  }

  skip({ length }: Element, depth = 0): void {
    if (length !== undefinedLength) {
      this.at += length;
      return;
    }
    if (depth > mostDepth) throw new RangeError('too deep');
    // Ends at the delimiter of an item or of a sequence.
    for (let inner = this.next(); inner.tag !== 0xfffe_e00d && inner.tag !== 0xfffe_e0dd; inner = this.next()) {
      this.skip(inner, depth + 1);
    }
  }

  text({ at, length }: Element): string {
    const bytes = new Uint8Array(this.view.buffer, this.view.byteOffset + at, length);
    return String.fromCharCode(...bytes).replace(/[\0 ]+$/, '');
  }
}

const series = 0x0020_000e;
const seriesDate = 0x0008_0021;
const studyDate = 0x0008_0020;
const rows = 0x0028_0010;
const columns = 0x0028_0011;
const bitsAllocated = 0x0028_0100;
const pixelRepresentation = 0x0028_0103;
const pixels = 0x7fe0_0010;
const syntax = 0x0002_0010;

function pictureOf(view: DataView, found: ReadonlyMap<number, number>, { at, length }: Element): Peek['picture'] {
  const [width = 0, height = 0, bits = 0] = [columns, rows, bitsAllocated].map((tag) => found.get(tag));
  const count = width * height;
  if (count === 0 || bits !== 16 || length < 2 * count || at + 2 * count > view.byteLength) return null;
  const isSigned = found.get(pixelRepresentation) === 1;
  const values = Array.from({ length: count }, (_, i) => (isSigned ? view.getInt16(at + 2 * i, true) : view.getUint16(at + 2 * i, true)));
  const sorted = values.filter((_, i) => i % 7 === 0).sort((a, b) => a - b);
  const [low = 0, high = 1] = [0.02, 0.99].map((part) => sorted[Math.floor(part * (sorted.length - 1))]);
  return { width, height, grey: Uint8ClampedArray.from(values, (value) => (255 * (value - low)) / (high - low || 1)) };
}

// Null where nothing can be told.
export function peekAt(bytes: ArrayBuffer): Peek | null {
  const view = new DataView(bytes);
  if (view.byteLength < 132 || view.getUint32(128) !== 0x4449_434d) return null;
  const reader = new Reader(view, 132, true);
  const texts = new Map<number, string>();
  const numbers = new Map<number, number>();
  let picture: Peek['picture'] = null;
  try {
    let isMeta = true;
    while (!reader.isOver) {
      if (isMeta && reader.peekGroup() !== 2) {
        isMeta = false;
        reader.isExplicit = texts.get(syntax) !== implicitLittle;
        if (reader.isExplicit && !explicitLittle.includes(texts.get(syntax) ?? '')) break;
      }
      const element = reader.next();
      if (element.tag === pixels) {
        picture = pictureOf(view, numbers, element);
        break;
      }
      if ([syntax, series, seriesDate, studyDate].includes(element.tag)) texts.set(element.tag, reader.text(element));
      if ([rows, columns, bitsAllocated, pixelRepresentation].includes(element.tag)) numbers.set(element.tag, view.getUint16(element.at, true));
      reader.skip(element);
    }
  } catch (error) {
    // It ends early, as far as this reader goes.
    if (!(error instanceof RangeError)) throw error;
  }
  const uid = texts.get(series);
  if (uid === undefined) return null;
  const [, year, month, day] = /^(\d{4})(\d{2})(\d{2})$/.exec(texts.get(seriesDate) ?? texts.get(studyDate) ?? '') ?? [];
  return { series: uid, date: year === undefined ? '' : `${year}-${month}-${day}`, picture };
}

const mostFiles = 64;
const mostBytes = 8 * 1024 * 1024;

// One file of each of these series, as far as some files spread over all of them have one.
export async function peekAtSeries(files: readonly Blob[], wanted: readonly string[]): Promise<Map<string, Peek>> {
  const found = new Map<string, Peek>();
  const step = Math.max(1, files.length / mostFiles);
  for (let at = step / 2; at < files.length && found.size < wanted.length; at += step) {
    const file = files[Math.floor(at)];
    const peek = file && file.size <= mostBytes ? peekAt(await file.arrayBuffer()) : null;
    if (peek && wanted.includes(peek.series) && !found.has(peek.series)) found.set(peek.series, peek);
  }
  return found;
}
