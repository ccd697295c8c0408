// Uploads with their progress.
import type { HeaderValues } from './busy';
import type { Connection } from './connection';
import { jsonOf } from './problem';
import { answerInParts } from './resume';
import type { Uploaded, UploadedVolume, UploadOptions, Volume } from './types';

// `keep`: the daemon keeps a file that leaves a choice open until a person has chosen.
export function uploadPath(options: Pick<UploadOptions, 'raw' | 'choices' | 'kept'>): string {
  const query = new URLSearchParams({ keep: 'true' });
  if (options.kept !== undefined) query.set('upload', options.kept);
  if (options.raw) {
    query.set('dims', options.raw.dims.join(','));
    query.set('type', options.raw.type);
    query.set('spacing', options.raw.spacing.join(','));
    query.set('byte_order', options.raw.byteOrder);
  }
  for (const [parameter, value] of Object.entries(options.choices ?? {})) query.set(parameter, value);
  return `/v1/volumes?${query.toString()}`;
}

// The header with the file's name. The address does not contain it, because logs contain addresses.
export function dispositionOf(name: string): string {
  return `attachment; filename*=UTF-8''${encodeURIComponent(name).replaceAll("'", '%27')}`;
}

// The result for each volume of the body. If there is only one, its `member` is empty.
export function uploadedOf(status: number, body: string, headers?: HeaderValues): UploadedVolume[] {
  const answer = jsonOf(status, body, headers);
  if (status === 207) return (answer as { volumes: UploadedVolume[] }).volumes;
  return [{ member: '', status, volume: answer as Volume, problem: null }];
}

function bytesOf(whole: unknown): Blob {
  if (whole instanceof Blob) return whole;
  if (whole instanceof ArrayBuffer || ArrayBuffer.isView(whole)) return new Blob([whole as BlobPart]);
  const isText = typeof whole === 'string';
  const given = isText ? 'a string' : ((whole as object | null)?.constructor?.name ?? String(whole));
  throw new TypeError(
    `upload takes a Blob, a File, an ArrayBuffer or a Uint8Array, not ${given}. ` +
      (isText ? 'It does not open files. ' : '') +
      "To upload a file in Node: upload(await readFile('head.nii.gz')), with readFile from 'node:fs/promises'.",
  );
}

// Continues after its connection broke. The server may have kept the bytes.
export async function upload(connection: Connection, given: unknown, options: UploadOptions): Promise<Uploaded> {
  const whole = bytesOf(given);
  const { name, signal, onBusy } = options;
  signal?.throwIfAborted();
  const path = uploadPath(options);
  const named: Record<string, string> = name === undefined ? {} : { 'Content-Disposition': dispositionOf(name) };
  const { status, headers, text } = await (options.kept === undefined
    ? answerInParts(connection, path, named, whole, options)
    : connection.ask(path, { method: 'POST', headers: named, signal, onBusy }));
  const kept = headers.get('Isomesh-Upload') ?? undefined;
  const volumes = uploadedOf(status, text, headers);
  options.onProgress?.(whole.size, whole.size);
  return { volumes, kept };
}
