// The files of an upload that are part of no volume.
import type { Volume } from '../api/types';

const mostNamed = 5;

// '' if there are none. Each volume of an upload may list the same ones.
export function skippedText(volumes: readonly Pick<Volume, 'ignored'>[]): string {
  const names = [...new Set(volumes.flatMap(({ ignored }) => ignored.map(({ name }) => name)))];
  if (names.length === 0) return '';
  const more = names.length > mostNamed ? ` and ${names.length - mostNamed} more` : '';
  return `${names.length === 1 ? '1 file was' : `${names.length} files were`} skipped: ${names.slice(0, mostNamed).join(', ')}${more}`;
}
