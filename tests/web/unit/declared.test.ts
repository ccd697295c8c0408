// What headers say of the samples behind them, before anything is sent.
import { describe, expect, it } from 'vitest';
import { declaredBy } from '@/volume/declared';
import { faultOf } from '@/volume/sniff';
import { seriesNifti, smallNrrd } from '../browser/files';

function blob(...parts: (Buffer | string)[]): Blob {
  return new Blob(parts.map((part) => new Uint8Array(Buffer.from(part))));
}

const metaHeader = 'ObjectType = Image\nNDims = 3\nDimSize = 4 3 2\nElementType = MET_SHORT\n';

function nifti2(): Buffer {
  const header = Buffer.alloc(544);
  header.writeInt32BE(540, 0);
  header.write('n+2', 4);
  header.writeInt16BE(16, 14);
  [3n, 4n, 3n, 2n].forEach((size, at) => header.writeBigInt64BE(size, 16 + 8 * at));
  header.writeBigInt64BE(544n, 168);
  return header;
}

describe('a header', () => {
  const bytesOf = (file: Buffer | string): unknown => declaredBy(new Uint8Array(Buffer.from(file)));

  it('tells dimensions and bytes', () => {
    expect(bytesOf(seriesNifti())).toEqual({ dims: [2, 3, 2, 2], bytes: 352 + 24, isElsewhere: false });
    expect(bytesOf(nifti2())).toEqual({ dims: [4, 3, 2], bytes: 544 + 48, isElsewhere: false });
    const nrrd = smallNrrd();
    expect(bytesOf(nrrd)).toEqual({ dims: [4, 3, 2], bytes: nrrd.length, isElsewhere: false });
    const meta = `${metaHeader}ElementDataFile = LOCAL\n`;
    expect(bytesOf(meta)).toEqual({ dims: [4, 3, 2], bytes: meta.length + 48, isElsewhere: false });
  });

  it('tells no bytes of what is compressed, and that samples are elsewhere', () => {
    const zipped = smallNrrd().toString('latin1').replace('raw', 'gzip');
    expect(bytesOf(zipped)).toMatchObject({ bytes: null, isElsewhere: false });
    expect(bytesOf(`${metaHeader}CompressedData = True\nElementDataFile = LOCAL\n`)).toMatchObject({ bytes: null });
    expect(bytesOf(`${metaHeader}ElementDataFile = a.raw\n`)).toMatchObject({ bytes: null, isElsewhere: true });
    expect(bytesOf(smallNrrd(['data file: a.raw']))).toMatchObject({ bytes: null, isElsewhere: true });
  });

  it('that is not understood tells nothing', () => {
    for (const text of ['', 'abc', 'NRRD0005\nsizes: a b\n\n', 'ObjectType = Image\n', 'DimSize = 4 3 2\n']) expect(bytesOf(text)).toBeNull();
  });
});

describe('what is surely no volume', () => {
  const told = async (...files: [string, Blob][]): Promise<string> =>
    (await faultOf(files.map(([path, file]) => ({ path, file }))))?.detail ?? '';
  const junk = blob('Dear colleague');

  it('is a file that was cut off, or a header alone', async () => {
    expect(await told(['a.nrrd', blob(smallNrrd())])).toBe('');
    expect(await told(['a.nrrd', blob(smallNrrd().subarray(0, -1))])).toMatch(/cut off.*4 × 3 × 2 samples.*Nothing was uploaded/);
    expect(await told(['a.nii', blob(seriesNifti().subarray(0, 360))])).toMatch(/cut off/);
    expect(await told(['a.mhd', blob(`${metaHeader}ElementDataFile = a.raw\n`)])).toMatch(/Choose both/);
  });

  it('is no file of a format that is known by its name alone', async () => {
    expect(await told(['a.mgz', junk])).toBe('');
    expect(await told(['lh.HEAD', junk], ['lh.BRIK', junk])).toBe('');
    expect(await told(['a.txt', junk])).toMatch(/match no supported format/);
  });

  it('are several files of which none is known', async () => {
    expect(await told(['a.txt', junk], ['b.txt', junk])).toMatch(/all 2 files/);
    expect(await told(['a.raw', junk], ['a.mhd', blob(`${metaHeader}ElementDataFile = a.raw\n`)])).toBe('');
  });
});
