// Small files that a daemon has something to say about.

export const samples = Buffer.from('abcdefghijklmnopqrstuvwx'); // 4 x 3 x 2

export function smallNrrd(fields: string[] = [], bytes: Buffer = samples): Buffer {
  const header = ['NRRD0004', 'type: uint8', 'dimension: 3', 'sizes: 4 3 2', 'encoding: raw', ...fields, '', ''];
  return Buffer.concat([Buffer.from(header.join('\n')), bytes]);
}

// Volumes of twelve samples each.
export function seriesNifti(bytes: Buffer = samples, dims = [2, 3, 2]): Buffer {
  const header = Buffer.alloc(352);
  header.writeInt32LE(348, 0);
  [4, ...dims, bytes.length / 12].forEach((size, at) => header.writeInt16LE(size, 40 + 2 * at));
  header.writeInt16LE(2, 70);
  header.writeInt16LE(8, 72);
  for (let at = 0; at < 5; at += 1) header.writeFloatLE(1, 76 + 4 * at);
  header.writeFloatLE(352, 108);
  header.writeInt16LE(2, 254);
  for (const at of [280, 300, 320]) header.writeFloatLE(1, at);
  header.write('n+1', 344);
  return Buffer.concat([header, bytes]);
}

// One volume with a qform that lies 5 mm beside the sform.
export function twoFormNifti(): Buffer {
  const bytes = seriesNifti(Buffer.from(samples).reverse().subarray(0, 12));
  bytes.writeInt16LE(1, 252);
  bytes.writeFloatLE(5, 268);
  return bytes;
}

// An element of explicit little-endian DICOM.
function element(group: number, tag: number, kind: string, value: string | Buffer): Buffer {
  let bytes = Buffer.from(value);
  if (bytes.length % 2 !== 0) bytes = Buffer.concat([bytes, Buffer.from(kind === 'UI' ? '\0' : ' ')]);
  const isLong = kind === 'OW';
  const head = Buffer.alloc(isLong ? 12 : 8);
  head.writeUInt16LE(group, 0);
  head.writeUInt16LE(tag, 2);
  head.write(kind, 4);
  if (isLong) head.writeUInt32LE(bytes.length, 8);
  else head.writeUInt16LE(bytes.length, 6);
  return Buffer.concat([head, bytes]);
}

function words(...values: number[]): Buffer {
  const bytes = Buffer.alloc(2 * values.length);
  values.forEach((value, at) => bytes.writeUInt16LE(value, 2 * at));
  return bytes;
}

interface Study {
  patient: string;
  uid: string;
  title: string;
}

// One slice of a CT of 4 x 4 samples, `index` mm from the first, with the name of its series.
export function ctSlice(index: number, frameOfReference: string, series: string, seriesUid = '1.2.3.4', study: Study = { patient: '', uid: '1.2.3', title: '' }): Buffer {
  const image = '1.2.840.10008.5.1.4.1.1.2';
  const uid = `1.2.826.0.1.3680043.9.1.${index}`;
  const meta = Buffer.concat([
    element(2, 2, 'UI', image),
    element(2, 3, 'UI', uid),
    element(2, 0x10, 'UI', '1.2.840.10008.1.2.1'),
  ]);
  const length = Buffer.alloc(4);
  length.writeUInt32LE(meta.length);
  return Buffer.concat([
    Buffer.alloc(128),
    Buffer.from('DICM'),
    element(2, 0, 'UL', length),
    meta,
    element(8, 0x16, 'UI', image),
    element(8, 0x18, 'UI', uid),
    element(8, 0x20, 'DA', '20240517'),
    element(8, 0x60, 'CS', 'CT'),
    element(8, 0x1030, 'LO', study.title),
    element(8, 0x103e, 'LO', series),
    element(0x10, 0x10, 'PN', study.patient),
    element(0x20, 0xd, 'UI', study.uid),
    element(0x20, 0xe, 'UI', seriesUid),
    element(0x20, 0x32, 'DS', `0\\0\\${index}`),
    element(0x20, 0x37, 'DS', '1\\0\\0\\0\\1\\0'),
    element(0x20, 0x52, 'UI', frameOfReference),
    element(0x28, 2, 'US', words(1)),
    element(0x28, 4, 'CS', 'MONOCHROME2'),
    element(0x28, 0x10, 'US', words(4)),
    element(0x28, 0x11, 'US', words(4)),
    element(0x28, 0x30, 'DS', '1\\1'),
    element(0x28, 0x100, 'US', words(16)),
    element(0x28, 0x101, 'US', words(16)),
    element(0x28, 0x102, 'US', words(15)),
    element(0x28, 0x103, 'US', words(0)),
    element(0x7fe0, 0x10, 'OW', words(...Array.from({ length: 16 }, (_, at) => at + index))),
  ]);
}
