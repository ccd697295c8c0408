import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { packTar, paxRecord, tarHeader, type NamedFile } from '@/volume/tar';

const named = (path: string, text: string): NamedFile => ({ path, file: new Blob([text]) });

async function unpacked(files: NamedFile[]): Promise<Record<string, string>> {
  const folder = mkdtempSync(join(tmpdir(), 'isomesh-tar-'));
  try {
    const archive = join(folder, 'archive.tar');
    writeFileSync(archive, Buffer.from(await packTar(files).arrayBuffer()));
    const names = execFileSync('tar', ['-tf', archive, '--quoting-style=literal'], { env: { LC_ALL: 'C.UTF-8', PATH: process.env.PATH } })
      .toString()
      .trimEnd()
      .split('\n');
    execFileSync('tar', ['-xf', archive, '-C', folder]);
    return Object.fromEntries(names.map((name) => [name, readFileSync(join(folder, name), 'utf8')]));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

describe('packTar', () => {
  it('makes what tar(1) unpacks to the same files', async () => {
    const files = [named('a/1.dcm', 'one'), named('a/2.dcm', 'x'.repeat(512)), named('b', 'y'.repeat(513))];
    expect(await unpacked(files)).toEqual({
      'a/1.dcm': 'one',
      'a/2.dcm': 'x'.repeat(512),
      b: 'y'.repeat(513),
    });
  });

  it('keeps names that are long or not ASCII', async () => {
    const long = `${'folder/'.repeat(20)}slice.dcm`;
    const files = [named(long, 'long'), named('Sch\u00e4del \u5934.dcm', 'umlaut')];
    expect(await unpacked(files)).toEqual({ [long]: 'long', 'Sch\u00e4del \u5934.dcm': 'umlaut' });
  });

  it('has the size of its parts and two empty blocks', () => {
    expect(packTar([named('x', 'seven b')]).size).toBe(512 + 512 + 1024);
    expect(tarHeader('x', 7, '0').length).toBe(512);
  });

  it('tells a size beyond what ustar holds in a pax record', () => {
    expect(paxRecord('size', '8589934592')).toBe('19 size=8589934592\n');
    // Its length counts the digits of the length.
    const record = paxRecord('path', 'p'.repeat(91));
    expect(record.length).toBe(Number.parseInt(record, 10));
  });
});
