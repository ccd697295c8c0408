// Packs the dropped or chosen files into one body to upload.
import type { Volume } from '../api/types';
import { packTar, type NamedFile } from './tar';

function readEntries(reader: FileSystemDirectoryReader): Promise<FileSystemEntry[]> {
  return new Promise((resolve, reject) => reader.readEntries(resolve, reject));
}

function fileOf(entry: FileSystemFileEntry): Promise<File> {
  return new Promise((resolve, reject) => entry.file(resolve, reject));
}

async function filesBelow(entry: FileSystemEntry): Promise<NamedFile[]> {
  const path = entry.fullPath.replace(/^\//, '');
  if (entry.isFile) return [{ path, file: await fileOf(entry as FileSystemFileEntry) }];
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const files: NamedFile[] = [];
  // A reader gives at most some hundred entries at a time, and none at the end.
  for (;;) {
    const entries = await readEntries(reader);
    if (entries.length === 0) return files;
    for (const child of entries) files.push(...(await filesBelow(child)));
  }
}

// To be called while the drop event is handled: its items are gone afterwards.
export function filesOfDrop(transfer: DataTransfer): Promise<NamedFile[]> {
  const entries = [...transfer.items].flatMap((item) => item.webkitGetAsEntry() ?? []);
  if (entries.length > 0) return Promise.all(entries.map(filesBelow)).then((all) => all.flat());
  return Promise.resolve(filesOfList(transfer.files));
}

export function filesOfList(list: FileList): NamedFile[] {
  return [...list].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
}

export interface Gathered {
  name: string;
  count: number;
  files: readonly NamedFile[];
  body: Blob;
  // With which it is sent at first.
  choices?: Readonly<Record<string, string>>;
  // Under which the daemon keeps the body while something of it is to be chosen.
  kept?: string;
  // What was made of its series so far, by their UIDs.
  stored: Map<string, Volume>;
}

// One file goes as it is, several are packed: all of them, since the server skips what is no part of a
// volume. Null when there is none.
export function gather(files: NamedFile[]): Gathered | null {
  const [first] = files;
  if (first === undefined) return null;
  if (files.length === 1) return { name: first.path, count: 1, files, body: first.file, stored: new Map() };
  const folder = first.path.includes('/') ? first.path.split('/')[0] : undefined;
  return { name: folder ?? `${files.length} files`, count: files.length, files, body: packTar(files), stored: new Map() };
}
