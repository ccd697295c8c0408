// Looks into DICOM files that are to be uploaded, so that a person can tell series apart: their dates and a picture. What
// cannot be read here (compressed, big-endian, not DICOM) has neither; the daemon decides what a file is.
import { dateOf } from './names';

export interface Picture {
  width: number;
  height: number;
  grey: Uint8ClampedArray;
}

// What the file has none of is ''.
export interface Peek {
  series: string;
  // YYYY-MM-DD
  date: string;
  patient: string;
  // Its UID, and what a person calls it.
  study: string;
  studyTitle: string;
  picture: Picture | null;
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
const studyDescription = 0x0008_1030;
const patientName = 0x0010_0010;
const patientId = 0x0010_0020;
const study = 0x0020_000d;
const rows = 0x0028_0010;
const columns = 0x0028_0011;
const bitsAllocated = 0x0028_0100;
const pixelRepresentation = 0x0028_0103;
const pixels = 0x7fe0_0010;
const syntax = 0x0002_0010;
const textTags = [syntax, series, seriesDate, study, studyDate, studyDescription, patientName, patientId];

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
      if (textTags.includes(element.tag)) texts.set(element.tag, reader.text(element));
      if ([rows, columns, bitsAllocated, pixelRepresentation].includes(element.tag)) numbers.set(element.tag, view.getUint16(element.at, true));
      reader.skip(element);
    }
  } catch (error) {
    // It ends early, as far as this reader goes.
    if (!(error instanceof RangeError)) throw error;
  }
  const uid = texts.get(series);
  if (uid === undefined) return null;
  const name = (texts.get(patientName) ?? '').replace(/\^+/g, ' ').trim();
  return {
    series: uid,
    date: dateOf(texts.get(seriesDate) ?? texts.get(studyDate)),
    patient: [name, texts.get(patientId)].filter(Boolean).join(', '),
    study: texts.get(study) ?? '',
    studyTitle: [texts.get(studyDescription), dateOf(texts.get(studyDate))].filter(Boolean).join(', '),
    picture,
  };
}

const mostFiles = 512;
const mostBytes = 8 * 1024 * 1024;
// The series is told before the samples.
const headBytes = 65_536;

// One file of each of these series, as far as some files spread over all of them have one.
export async function peekAtSeries(files: readonly Blob[], wanted: readonly string[]): Promise<Map<string, Peek>> {
  const found = new Map<string, Peek>();
  const isNew = (peek: Peek | null): peek is Peek => peek !== null && wanted.includes(peek.series) && !found.has(peek.series);
  const step = Math.max(1, files.length / mostFiles);
  for (let at = step / 2; at < files.length && found.size < wanted.length; at += step) {
    const file = files[Math.floor(at)];
    if (!file || file.size > mostBytes || !isNew(peekAt(await file.slice(0, headBytes).arrayBuffer()))) continue;
    const whole = peekAt(await file.arrayBuffer());
    if (isNew(whole)) found.set(whole.series, whole);
  }
  return found;
}

export interface SeriesGroup {
  patient: string;
  study: string;
  studyTitle: string;
  series: string[];
}

// The series by patients and studies, each in the order in which it comes first. Those that nothing is known of are a group
// of their own, at the end.
export function grouped(series: readonly string[], peeks: ReadonlyMap<string, Peek>): SeriesGroup[] {
  const groups = new Map<string, SeriesGroup>();
  const isKnown = (uid: string): boolean => peeks.has(uid);
  for (const uid of [...series.filter(isKnown), ...series.filter((one) => !isKnown(one))]) {
    const { patient = '', study: of = '', studyTitle = '' } = peeks.get(uid) ?? {};
    const key = JSON.stringify(isKnown(uid) ? [patient, of] : []);
    const group = groups.get(key) ?? { patient, study: of, studyTitle, series: [] };
    group.series.push(uid);
    groups.set(key, group);
  }
  // A patient's studies stand together.
  const patients = [...new Set([...groups.values()].map(({ patient }) => patient))];
  return [...groups.values()].sort((a, b) => patients.indexOf(a.patient) - patients.indexOf(b.patient));
}
