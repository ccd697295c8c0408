import { describe, expect, it } from 'vitest';
import { grouped, peekAt, peekAtSeries, type Peek } from '@/volume/dicom_peek';
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

  it('tells patient and study', () => {
    const of = { patient: 'Doe^Jane', uid: '1.5', title: 'Head' };
    const peek = peekAt(bytesOf(ctSlice(1, '1.9', 'chest', '1.2', of)));
    expect(peek).toMatchObject({ patient: 'Doe Jane', study: '1.5', studyTitle: 'Head, 2024-05-17' });
  });

  it('finds series that come late in many files, and reads only one of each whole', async () => {
    const whole: string[] = [];
    const files = Array.from({ length: 700 }, (_, index) => {
      const uid = index < 640 ? '1.1' : '1.2';
      const blob = new Blob([bytesOf(ctSlice(index, '1.9', 'a', uid))]);
      return Object.assign(blob, { arrayBuffer: () => (whole.push(uid), Blob.prototype.arrayBuffer.call(blob)) });
    });
    expect((await peekAtSeries(files, ['1.1', '1.2'])).size).toBe(2);
    expect(whole).toEqual(['1.1', '1.2']);
  });

  it('puts series below their patients and studies, and unknown ones last', () => {
    const peek = (series: string, patient: string, study: string): [string, Peek] => [series, { series, date: '', patient, study, studyTitle: study, picture: null }];
    const peeks = new Map([peek('a', 'Jane', '1'), peek('b', 'Joe', '2'), peek('c', 'Jane', '3'), peek('d', 'Jane', '1')]);
    expect(grouped(['x', 'a', 'b', 'c', 'd'], peeks).map(({ patient, study, series }) => [patient, study, series.join('')])).toEqual([
      ['Jane', '1', 'ad'],
      ['Jane', '3', 'c'],
      ['Joe', '2', 'b'],
      ['', '', 'x'],
    ]);
  });
});
