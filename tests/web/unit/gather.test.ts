import { describe, expect, it } from 'vitest';
import { gather } from '@/volume/gather';
import { packTar, type NamedFile } from '@/volume/tar';

const named = (path: string, text: string): NamedFile => ({ path, file: new Blob([text]) });

describe('gather', () => {
  it('sends all files, since the server skips what is no part of a volume', async () => {
    const files = ['1.dcm', 'README.txt', 'report.pdf', '.DS_Store', 'Thumbs.db'].map((name) => named(`head/${name}`, name));
    files.push(named('head/empty', ''));
    const gathered = gather(files);
    expect(gathered?.name).toBe('head');
    expect(gathered?.count).toBe(6);
    expect(await gathered?.body.text()).toBe(await packTar(files).text());
  });

  it('sends one file as it is', async () => {
    const gathered = gather([named('head.nii', 'volume')]);
    expect(gathered?.name).toBe('head.nii');
    expect(await gathered?.body.text()).toBe('volume');
    expect(gather([])).toBeNull();
  });
});
