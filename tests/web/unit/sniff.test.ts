import { gzipSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';
import { mayBeVolume } from '@/volume/sniff';
import { tarHeader } from '@/volume/tar';

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

// As before POSIX: a name, sizes and a checksum.
function oldTar(): Buffer {
  const header = Buffer.from(tarHeader('scan.nii', 4, '0')).fill(0, 257, 265);
  const sum = header.fill(' ', 148, 156).reduce((total, byte) => total + byte, 0);
  header.write(sum.toString(8).padStart(6, '0') + '\0 ', 148, 'latin1');
  return Buffer.concat([header, Buffer.alloc(600)]);
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
  'a TAR of before POSIX': oldTar(),
  TIFF: at(0, 'II*\0'),
  'BigTIFF, big-endian': at(0, 'MM\0+\0\b'),
  HDF5: at(0, '\u0089HDF\r\n\u001a\n'),
  NumPy: at(0, '\u0093NUMPY\u0001\0'),
  MIF: Buffer.from('mrtrix image\ndim: 4,4,4\n'),
  'VTK, legacy': Buffer.from('# vtk DataFile Version 3.0\ntitle\nBINARY\n'),
  'Scanco ISQ': at(0, 'CTDATA-HEADER_V1'),
  MGH: at(0, '\0\0\0\u0001\0\0\0\u0004'),
  MRC: at(208, 'MAP '),
  GIPL: at(252, '\u00ef\u00ff\u00e9\u00b0'),
  'PAR/REC': Buffer.from('# === DATA DESCRIPTION FILE ===\n#\n# CLINICAL TRYOUT             Research image export tool     V4.2\n'),
};

const unknown: Record<string, Buffer> = {
  noise: Buffer.from(Array.from({ length: 4096 }, (_, n) => (n * 7919 + 101) % 251)),
  nothing: Buffer.alloc(0),
  zeros: Buffer.alloc(4096),
  "a folder's view on macOS, .DS_Store": at(0, '\0\0\0\u0001Bud1\0\0\u0010\0'),
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
