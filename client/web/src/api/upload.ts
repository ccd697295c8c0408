// Uploads with their progress.
import { addressOf, connected, headers, unauthorized } from './client';
import { ApiError, errorOf, unreachable } from './problem';
import { answerInParts } from './resume';
import type { SampleType, UploadedVolume, Volume } from './types';

export interface RawDescription {
  dims: [number, number, number];
  type: SampleType;
  spacing: [number, number, number];
  byteOrder: 'little' | 'big';
}

export interface UploadOptions {
  raw?: RawDescription;
  // What chooses and accepts, by its parameter of the query.
  choices?: Readonly<Record<string, string>>;
  // What the file is called.
  name?: string;
  // The name by which the daemon keeps the body, which is not sent again then.
  kept?: string;
  signal?: AbortSignal;
  // Bytes that are sent; all of them while the daemon reads the volume.
  onProgress?: (sent: number, total: number) => void;
}

export interface Uploaded {
  volumes: UploadedVolume[];
  // Under which the daemon keeps the body, as long as something of it may be chosen.
  kept?: string;
}

// What is refused stays with the daemon until a person has chosen what of it to read.
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

// The header that tells a file's name, which is in no address because logs hold those.
export function dispositionOf(name: string): string {
  return `attachment; filename*=UTF-8''${encodeURIComponent(name).replaceAll("'", '%27')}`;
}

// What became of each volume of the body; the only one has an empty member.
export function uploadedOf(status: number, body: string): UploadedVolume[] {
  const answer: unknown = JSON.parse(body);
  if (status === 207) return (answer as { volumes: UploadedVolume[] }).volumes;
  return [{ member: '', status, volume: answer as Volume, problem: null }];
}

// What fewer bytes are is sent in one request.
const resumableBytes = 8 << 20;

// A large body goes on where its connection broke.
export function upload(whole: Blob, options: UploadOptions = {}): Promise<Uploaded> {
  const isSmall = whole.size < resumableBytes || options.kept !== undefined;
  // Of a request's body XMLHttpRequest tells the progress, which fetch does not. Node has only that.
  return isSmall && typeof XMLHttpRequest !== 'undefined' ? uploadInOne(whole, options) : uploadInParts(whole, options);
}

async function uploadInParts(whole: Blob, options: UploadOptions): Promise<Uploaded> {
  const name: Record<string, string> =
    options.name === undefined ? {} : { 'Content-Disposition': dispositionOf(options.name) };
  const answer = await answerInParts(uploadPath(options), name, whole, options);
  const kept = answer.headers.get('Isomesh-Upload') ?? undefined;
  const text = await answer.text();
  if (!answer.ok) throw errorOf(answer.status, text, kept);
  return { volumes: uploadedOf(answer.status, text), kept };
}

function uploadInOne(whole: Blob, options: UploadOptions): Promise<Uploaded> {
  const body = options.kept === undefined ? whole : new Blob();
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', addressOf(uploadPath(options)));
    for (const [name, value] of Object.entries(headers())) request.setRequestHeader(name, value);
    request.setRequestHeader('Content-Type', 'application/octet-stream');
    if (options.name !== undefined) request.setRequestHeader('Content-Disposition', dispositionOf(options.name));
    let sent = 0;
    request.upload.onprogress = (event) => {
      sent = event.loaded;
      options.onProgress?.(event.loaded, body.size);
    };
    request.upload.onload = () => options.onProgress?.(body.size, body.size);
    request.onload = () => {
      connected.value = true;
      const kept = request.getResponseHeader('Isomesh-Upload') ?? undefined;
      if ([200, 201, 207].includes(request.status)) {
        resolve({ volumes: uploadedOf(request.status, request.responseText), kept });
        return;
      }
      if (request.status === 401) unauthorized.value = true;
      reject(errorOf(request.status, request.responseText, kept));
    };
    request.onerror = () => {
      // A server that refuses early closes the connection while the body is still on its way, which
      // looks the same from here.
      if (sent > 0 && sent < body.size) {
        reject(
          new ApiError(
            0,
            'The upload was cut off',
            'The connection ended before the whole volume was sent. The network failed, or the ' +
              'volume is larger than the server takes.',
          ),
        );
      } else {
        connected.value = false;
        reject(unreachable());
      }
    };
    request.onabort = () => reject(new DOMException('The upload was cancelled', 'AbortError'));
    options.signal?.addEventListener('abort', () => request.abort());
    request.send(body);
  });
}
