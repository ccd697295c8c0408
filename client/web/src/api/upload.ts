// Uploads with their progress.
import type { HeaderValues } from './busy';
import type { Answer, Connection } from './connection';
import { ApiError, jsonOf, unreachable } from './problem';
import { answerInParts, assertReadable } from './resume';
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

// Smaller uploads are sent in one request.
const resumableBytes = 8 << 20;

// A large upload continues after its connection broke.
export async function upload(connection: Connection, given: unknown, options: UploadOptions): Promise<Uploaded> {
  const whole = bytesOf(given);
  options.signal?.throwIfAborted();
  const { status, headers, text } = await answerTo(connection, whole, options);
  const kept = headers.get('Isomesh-Upload') ?? undefined;
  const volumes = uploadedOf(status, text, headers);
  options.onProgress?.(whole.size, whole.size);
  return { volumes, kept };
}

function answerTo(connection: Connection, whole: Blob, options: UploadOptions): Promise<Answer> {
  const path = uploadPath(options);
  const named: Record<string, string> =
    options.name === undefined ? {} : { 'Content-Disposition': dispositionOf(options.name) };
  // The server has the bytes.
  const { signal, onBusy } = options;
  if (options.kept !== undefined) return connection.ask(path, { method: 'POST', headers: named, signal, onBusy });
  // XMLHttpRequest reports the progress of a request's body, and fetch does not. Node has only fetch.
  return whole.size < resumableBytes && typeof XMLHttpRequest !== 'undefined'
    ? connection.patiently(() => answerInOne(connection, path, named, whole, options), { signal, onBusy })
    : answerInParts(connection, path, named, whole, options);
}

function answerInOne(
  connection: Connection,
  path: string,
  named: Record<string, string>,
  whole: Blob,
  options: UploadOptions,
): Promise<Answer> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', connection.addressOf(path));
    for (const [name, value] of Object.entries(connection.headers(named))) request.setRequestHeader(name, value);
    request.setRequestHeader('Content-Type', 'application/octet-stream');
    let sent = 0;
    request.upload.onprogress = (event) => {
      sent = event.loaded;
      options.onProgress?.(event.loaded, whole.size);
    };
    request.upload.onload = () => options.onProgress?.(whole.size, whole.size);
    request.onload = () => {
      connection.connected.value = true;
      if (request.status === 401) connection.unauthorized.value = true;
      const headers = { get: (name: string) => request.getResponseHeader(name) };
      resolve({ status: request.status, headers, text: request.responseText });
    };
    const failure = (): ApiError => {
      // This may also be a server that rejects the upload early: it closes the connection while the body is sent.
      if (sent > 0 && sent < whole.size) {
        return new ApiError(
          0,
          'The upload was interrupted',
          'The connection was lost before the whole volume was sent. Either the network failed, or the ' +
            'volume is larger than the server allows.',
        );
      }
      connection.connected.value = false;
      return unreachable(undefined, connection.base);
    };
    request.onerror = () => void assertReadable(whole).then(() => reject(failure()), reject);
    request.onabort = () => reject(options.signal?.reason as Error);
    const abort = (): void => request.abort();
    options.signal?.addEventListener('abort', abort);
    request.onloadend = () => options.signal?.removeEventListener('abort', abort);
    request.send(whole);
  });
}
