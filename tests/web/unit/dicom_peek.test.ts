import { describe, expect, it } from 'vitest';
import { peekAt, peekAtSeries } from '@/volume/dicom_peek';
import { ctSlice } from '../browser/files';

function bytesOf(buffer: Buffer): ArrayBuffer {
  return Uint8Array.from(buffer).buffer;
}

const slice = ctSlice(3, '1.9', 'chest', '1.2.3.9');

describe('a look into DICOM files', () => {
  it('finds the series, its date, and a picture', () => {
    const peek = peekAt(bytesOf(slice));
    expect(peek).toMatchObject({ series: '1.2.3.9', date: '2024-05-17', picture: { width: 4, height: 4 } });
    const grey = [...(peek?.picture?.grey ?? [])];
    expect(grey).toEqual([...grey].sort((a, b) => a - b));
  });

  it('tells what it can of a file that ends anywhere, and nothing of others', () => {
    for (let length = 0; length < slice.length; length += 1) {
      const peek = peekAt(bytesOf(slice.subarray(0, length)));
      if (peek) expect(peek.picture).toBeNull();
    }
    expect(peekAt(bytesOf(Buffer.alloc(400, 7)))).toBeNull();
  });

  it('looks for one file of each series', async () => {
    const files = [1, 2, 3, 4].map((index) => new Blob([bytesOf(ctSlice(index, '1.9', 'a', index < 3 ? '1.1' : '1.2'))]));
    const found = await peekAtSeries([new Blob(['text']), ...files], ['1.1', '1.2', '1.3']);
    expect([...found.keys()].sort()).toEqual(['1.1', '1.2']);
  });
});
