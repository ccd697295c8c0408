import { gzipSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';
import { mayBeVolume } from '@/volume/sniff';

function nifti(size: number, isLittle: boolean): Buffer {
  const header = Buffer.alloc(600);
  if (isLittle) header.writeInt32LE(size);
  else header.writeInt32BE(size);
  return header;
}

function at(offset: number, text: string): Buffer {
  const bytes = Buffer.alloc(600);
  bytes.write(text, offset, 'latin1');
  return bytes;
}

const known: Record<string, Buffer> = {
  'NIfTI-1': nifti(348, true),
  'NIfTI-1, big-endian': nifti(348, false),
  'NIfTI-2': nifti(540, true),
  NRRD: Buffer.from('NRRD0005\ntype: short\n'),
  MetaImage: Buffer.from('ObjectType = Image\nNDims = 3\n'),
  VTK: Buffer.from('<?xml version="1.0"?>\n<VTKFile type="ImageData">'),
  DICOM: at(128, 'DICM'),
  'DICOM without a preamble': at(0, '\u0008\u0000\u0005\u0000CS'),
  ZIP: at(0, 'PK\u0003\u0004'),
  TAR: at(257, 'ustar'),
  'a TAR that bzip2 packed': at(0, 'BZh91AY'),
};

const unknown: Record<string, Buffer> = {
  noise: Buffer.from(Array.from({ length: 4096 }, (_, n) => (n * 7919 + 101) % 251)),
  nothing: Buffer.alloc(0),
  zeros: Buffer.alloc(4096),
  'a picture': at(0, '\u0089PNG\r\n'),
  prose: Buffer.from('Dear colleague, enclosed is the volume.'),
};

const blob = (bytes: Buffer): Blob => new Blob([new Uint8Array(bytes)]);

describe('the first bytes of a file', () => {
  it.each(Object.entries(known))('may be those of %s', async (_, bytes) => {
    expect(await mayBeVolume(blob(bytes))).toBe(true);
    expect(await mayBeVolume(blob(gzipSync(bytes)))).toBe(true);
    // Much more follows, and is not looked at.
    const long = gzipSync(Buffer.concat([bytes, Buffer.from(Array.from({ length: 300_000 }, (_v, n) => (n * n) % 253))]));
    expect(await mayBeVolume(blob(long))).toBe(true);
  });

  it.each(Object.entries(unknown))('are no volume: %s', async (_, bytes) => {
    expect(await mayBeVolume(blob(bytes))).toBe(false);
    expect(await mayBeVolume(blob(gzipSync(bytes)))).toBe(false);
  });
});
