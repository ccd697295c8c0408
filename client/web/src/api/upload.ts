// Uploads with their progress, which fetch cannot tell.
import { connected, headers, unauthorized } from './client';
import { ApiError, errorOf, unreachable } from './problem';
import type { SampleType, Volume } from './types';

export interface RawDescription {
  dims: [number, number, number];
  type: SampleType;
  spacing: [number, number, number];
  byteOrder: 'little' | 'big';
}

export interface UploadOptions {
  raw?: RawDescription;
  series?: string;
  signal: AbortSignal;
  // Bytes that are sent; all of them while the daemon reads the volume.
  onProgress: (sent: number, total: number) => void;
}

export function uploadPath(options: Pick<UploadOptions, 'raw' | 'series'>): string {
  const query = new URLSearchParams();
  if (options.raw) {
    query.set('dims', options.raw.dims.join(','));
    query.set('type', options.raw.type);
    query.set('spacing', options.raw.spacing.join(','));
    query.set('byte_order', options.raw.byteOrder);
  }
  if (options.series !== undefined) query.set('series', options.series);
  const text = query.toString();
  return `/v1/volumes${text === '' ? '' : `?${text}`}`;
}

export interface Uploaded {
  volume: Volume;
  isNew: boolean;
}

export function upload(body: Blob, options: UploadOptions): Promise<Uploaded> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', uploadPath(options));
    for (const [name, value] of Object.entries(headers())) request.setRequestHeader(name, value);
    request.setRequestHeader('Content-Type', 'application/octet-stream');
    let sent = 0;
    request.upload.onprogress = (event) => {
      sent = event.loaded;
      options.onProgress(event.loaded, body.size);
    };
    request.upload.onload = () => options.onProgress(body.size, body.size);
    request.onload = () => {
      connected.value = true;
      if (request.status === 200 || request.status === 201) {
        resolve({
          volume: JSON.parse(request.responseText) as Volume,
          isNew: request.status === 201,
        });
        return;
      }
      if (request.status === 401) unauthorized.value = true;
      reject(errorOf(request.status, request.responseText));
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
    options.signal.addEventListener('abort', () => request.abort());
    request.send(body);
  });
}
