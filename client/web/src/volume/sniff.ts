// Checks the first bytes of a file before gigabytes are sent in vain. It only finds files that are certainly
// not volumes; the daemon decides about all others.

import { volumeFormats } from '../../generated/parameters';
import { ApiError } from '../api/problem';
import type { NamedFile } from './tar';

const headBytes = 1024;
// This much of a compressed file certainly holds the first bytes of its contents.
const packedBytes = 65_536;

function startsWith(head: Uint8Array, ...bytes: number[]): boolean {
  return bytes.every((byte, at) => head[at] === byte);
}

function textOf(head: Uint8Array, from = 0, length = headBytes): string {
  return String.fromCharCode(...head.subarray(from, from + length));
}

function isNifti(head: Uint8Array): boolean {
  if (head.length < 348) return false;
  const view = new DataView(head.buffer, head.byteOffset, head.byteLength);
  return [true, false].some((isLittle) => [348, 540].includes(view.getInt32(0, isLittle)));
}

// Without a preamble it begins with an element of the group 0002 or 0008.
function isDicom(head: Uint8Array): boolean {
  return textOf(head, 128, 4) === 'DICM' || startsWith(head, 2, 0) || startsWith(head, 8, 0);
}

function isText(head: Uint8Array): boolean {
  // NRRD, a header of MetaImage (Name = value), a VTK image.
  return /^NRRD|^\s*[A-Za-z]\w*\s*=|^(\u00ef\u00bb\u00bf)?\s*<(\?xml|VTKFile)/.test(textOf(head));
}

// Old ones have a checksum only.
function isTar(head: Uint8Array): boolean {
  if (textOf(head, 257, 5) === 'ustar') return true;
  const sum = head.subarray(0, 512).reduce((total, byte, at) => total + (at >= 148 && at < 156 ? 32 : byte), 0);
  return head[0] !== 0 && head.length >= 512 && Number.parseInt(textOf(head, 148, 8).trim(), 8) === sum;
}

function isArchive(head: Uint8Array): boolean {
  return textOf(head, 0, 2) === 'PK' || isTar(head);
}

// The letters that tell the other formats, and where they are. Gaussian cube has none.
const tellers: readonly (readonly [at: number, letters: string])[] = [
  ...['II*\0', 'MM\0*', 'II+\0', 'MM\0+'].map((letters) => [0, letters] as const), // TIFF
  [0, '\u0089HDF'],
  [0, '\u0093NUMPY'],
  [0, 'mrtrix image'],
  [0, '# vtk DataFile'],
  [0, 'CTDATA-HEADER'], // Scanco ISQ
  [0, '\0\0\0\u0001\0'], // MGH: version 1 and a width below 2^24
  [208, 'MAP'], // MRC
  [252, '\u00ef\u00ff\u00e9\u00b0'], // GIPL
  [252, '\u002a\u00e3\u0089\u00b8'],
];

function isTold(head: Uint8Array): boolean {
  return tellers.some(([at, letters]) => textOf(head, at, letters.length) === letters) || /^#[^]*CLINICAL TRYOUT/.test(textOf(head)); // PAR/REC
}

// Compression other than gzip, which browsers cannot decompress.
function isPackedOtherwise(head: Uint8Array): boolean {
  return (
    textOf(head, 0, 3) === 'BZh' ||
    startsWith(head, 0xfd, 0x37, 0x7a, 0x58, 0x5a) ||
    startsWith(head, 0x28, 0xb5, 0x2f, 0xfd)
  );
}

async function bytesOf(file: Blob, count: number): Promise<Uint8Array<ArrayBuffer>> {
  return new Uint8Array(await file.slice(0, count).arrayBuffer());
}

// The first bytes of what was compressed; none when it is broken.
async function unpacked(file: Blob): Promise<Uint8Array> {
  const reader = file.slice(0, packedBytes).stream().pipeThrough(new DecompressionStream('gzip')).getReader();
  const found: number[] = [];
  try {
    while (found.length < headBytes) {
      const { done, value } = await reader.read();
      if (done) break;
      found.push(...(value as Uint8Array).subarray(0, headBytes - found.length));
    }
  } catch {
    // Cut off in the middle of the file, as it has to be.
  }
  reader.cancel().catch(() => undefined);
  return Uint8Array.from(found);
}

function isKnown(head: Uint8Array): boolean {
  return [isNifti, isDicom, isText, isArchive, isTold, isPackedOtherwise].some((test) => test(head));
}

// Formats whose first bytes are tested above, and raw samples, which need a description.
const sniffed = ['nifti', 'nrrd', 'metaimage', 'vti', 'dicom', 'raw'];
const suffixes = volumeFormats
  .filter(({ name }) => !sniffed.includes(name))
  .flatMap((format) => format.suffixes.map((suffix) => suffix.toLowerCase()));

// A name is enough, also for a picture, which is a volume only among others.
function isNamedAsVolume(path: string): boolean {
  const name = path.toLowerCase().replace(/\.gz$/, '');
  return suffixes.some((suffix) => name.endsWith(suffix.replace(/\.gz$/, '')));
}

export async function mayBeVolume(file: Blob, path = ''): Promise<boolean> {
  if (isNamedAsVolume(path)) return true;
  const head = await bytesOf(file, headBytes);
  return isKnown(startsWith(head, 0x1f, 0x8b) ? await unpacked(file) : head);
}

function unsent(status: 415 | 422, detail: string): ApiError {
  const title = status === 415 ? 'This file is not a supported volume' : 'This volume is incomplete';
  return new ApiError(status, title, `${detail} Nothing was uploaded.`);
}

// The reason why the file is certainly not a volume; null if it may be one.
async function faultOfOne({ path, file }: NamedFile): Promise<ApiError | null> {
  if (file.size === 0) return unsent(422, `${path} is empty.`);
  if (!(await mayBeVolume(file, path))) return unsent(415, `The first bytes of ${path} match no supported format.`);
  return null;
}

// The same for files that are sent together. A data file beside a header has no known first bytes.
export async function faultOf(files: readonly NamedFile[]): Promise<ApiError | null> {
  const [only] = files;
  if (only && files.length === 1) return faultOfOne(only);
  for (const { path, file } of files) if (await mayBeVolume(file, path)) return null;
  return unsent(415, `The first bytes of all ${files.length} files match no supported format.`);
}
