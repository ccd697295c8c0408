// What a file's header says of its samples, so that one that was cut off, or whose samples stand elsewhere, is not sent
// for nothing. Says nothing of what it does not understand; the daemon judges.

export interface Declared {
  dims: number[];
  // Of header and samples; null where they are compressed.
  bytes: number | null;
  // The samples stand in another file.
  isElsewhere: boolean;
}

type Fields = ReadonlyMap<string, string>;

const nrrdBytes: readonly [RegExp, number][] = [
  [/^(signed char|int8|int8_t|uchar|unsigned char|uint8|uint8_t)$/, 1],
  [/^(short|short int|signed short|signed short int|int16|int16_t|ushort|unsigned short|unsigned short int|uint16|uint16_t)$/, 2],
  [/^(int|signed int|int32|int32_t|uint|unsigned int|uint32|uint32_t|float)$/, 4],
  [/^(longlong|long long|int64|int64_t|ulonglong|unsigned long long|uint64|uint64_t|double)$/, 8],
];

const metaBytes: Readonly<Record<string, number>> = {
  MET_CHAR: 1,
  MET_UCHAR: 1,
  MET_SHORT: 2,
  MET_USHORT: 2,
  MET_INT: 4,
  MET_UINT: 4,
  MET_FLOAT: 4,
  MET_LONG_LONG: 8,
  MET_ULONG_LONG: 8,
  MET_DOUBLE: 8,
};

function numbersOf(text: string | undefined): number[] {
  return (text ?? '').trim().split(/\s+/).map(Number);
}

function areDims(dims: readonly number[]): boolean {
  return dims.length > 0 && dims.every((count) => Number.isInteger(count) && count > 0);
}

function bytesOf(dims: readonly number[], each: number): number {
  return dims.reduce((product, count) => product * count, each);
}

// The lines NAME SEPARATOR VALUE, by their names in lower case.
function fieldsOf(text: string, separator: string): Fields {
  return new Map(
    text.split(/\r?\n/).flatMap((line): [string, string][] => {
      const at = line.indexOf(separator);
      return at < 0 ? [] : [[line.slice(0, at).trim().toLowerCase(), line.slice(at + separator.length).trim()]];
    }),
  );
}

export interface NiftiHead {
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
export function niftiHead(head: Uint8Array): NiftiHead | null {
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
  if (!areDims(dims)) return null;
  return {
    dims,
    begin: isSecond ? Number(view.getBigInt64(168, isLittle)) : view.getFloat32(108, isLittle),
    type: view.getInt16(isSecond ? 12 : 70, isLittle),
    bits: view.getInt16(isSecond ? 14 : 72, isLittle),
    isLittle,
    isElsewhere: !magic.startsWith('n+'),
  };
}

function ofNifti(bytes: Uint8Array): Declared | null {
  const head = niftiHead(bytes);
  if (!head) return null;
  const { dims, begin, bits, isElsewhere } = head;
  const isTold = bits > 0 && bits % 8 === 0 && begin >= 0 && !isElsewhere;
  return { dims, bytes: isTold ? begin + bytesOf(dims, bits / 8) : null, isElsewhere };
}

function ofNrrd(text: string): Declared | null {
  const end = /\r?\n\r?\n/.exec(text);
  const fields = fieldsOf(end ? text.slice(0, end.index) : text, ':');
  const dims = numbersOf(fields.get('sizes'));
  if (!areDims(dims)) return null;
  const isElsewhere = fields.has('data file') || fields.has('datafile');
  const each = nrrdBytes.find(([names]) => names.test((fields.get('type') ?? '').toLowerCase()))?.[1];
  const isRaw = fields.get('encoding')?.toLowerCase() === 'raw' && !isElsewhere && end !== null;
  const begin = end ? end.index + end[0].length : 0;
  return { dims, bytes: isRaw && each !== undefined ? begin + bytesOf(dims, each) : null, isElsewhere };
}

function ofMetaImage(text: string): Declared | null {
  const end = /ElementDataFile\s*=[^\n]*\n?/.exec(text);
  if (!end) return null;
  const fields = fieldsOf(text.slice(0, end.index + end[0].length), '=');
  const dims = numbersOf(fields.get('dimsize'));
  if (!areDims(dims)) return null;
  const isElsewhere = !/^local$/i.test(fields.get('elementdatafile') ?? '');
  const each = metaBytes[fields.get('elementtype') ?? ''];
  const channels = Number(fields.get('elementnumberofchannels') ?? 1);
  const isRaw = !/^true$/i.test(fields.get('compresseddata') ?? '') && !isElsewhere;
  const begin = end.index + end[0].length;
  return { dims, bytes: isRaw && each !== undefined ? begin + bytesOf(dims, each * channels) : null, isElsewhere };
}

// Of the first bytes of a file, as they are when nothing is compressed. Null where they tell nothing of it.
export function declaredBy(head: Uint8Array): Declared | null {
  const text = new TextDecoder('latin1').decode(head);
  if (text.startsWith('NRRD')) return ofNrrd(text);
  if (/^\s*[A-Za-z]\w*\s*=/.test(text)) return ofMetaImage(text);
  return ofNifti(head);
}
