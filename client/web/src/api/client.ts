// The daemon's routes as functions, on a page and in Node. Failures are thrown as ApiError.
import { asApiError, errorOf } from './problem';
import { Signal } from '../ui/signal';
import type { Axis, Estimate, Histogram, Job, JobList, JobRequest, MeshFormat, Volume, VolumeLabels, VolumeList } from './types';

const volumesPerPage = 60;

// The token that requests carry; empty without one.
export const token = new Signal<string>('');
let server = '';

// Says where the daemon is, such as http://127.0.0.1:8080, and the token that it wants. Without a server it
// is where the page comes from.
export function connect(to: { server?: string; token?: string }): void {
  server = (to.server ?? '').replace(/\/+$/, '');
  token.value = to.token ?? '';
}

export function addressOf(path: string): string {
  return server + path;
}

// Whether the last request got through.
export const connected = new Signal<boolean>(true);
// Whether the daemon wants a token that we do not have.
export const unauthorized = new Signal<boolean>(false);

export function headers(more: Record<string, string> = {}): Record<string, string> {
  return token.value === '' ? more : { ...more, Authorization: `Bearer ${token.value}` };
}

// Any answer, refusals too.
export async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(addressOf(path), { ...init, headers: headers(init.headers as Record<string, string>) });
  } catch (error) {
    if (error instanceof DOMException && error.name === 'AbortError') throw error;
    connected.value = false;
    throw asApiError(error);
  }
  connected.value = true;
  if (answer.status === 401) unauthorized.value = true;
  return answer;
}

export async function send(path: string, init: RequestInit = {}): Promise<Response> {
  const answer = await ask(path, init);
  if (!answer.ok) throw errorOf(answer.status, await answer.text());
  return answer;
}

export async function json<T>(path: string, init?: RequestInit): Promise<T> {
  return (await (await send(path, init)).json()) as T;
}

// The newest first, in pages.
export function listVolumes(cursor = '', signal?: AbortSignal): Promise<VolumeList> {
  const query = new URLSearchParams({ order: 'newest', limit: String(volumesPerPage) });
  if (cursor !== '') query.set('cursor', cursor);
  return json(`/v1/volumes?${query.toString()}`, { signal });
}

export function getVolume(id: string): Promise<Volume> {
  return json(`/v1/volumes/${encodeURIComponent(id)}`);
}

// Gives the volume another name, or none.
export function renameVolume(id: string, name: string | null): Promise<Volume> {
  return json(`/v1/volumes/${encodeURIComponent(id)}`, {
    method: 'PATCH',
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify({ name }),
  });
}

export async function eraseVolume(id: string): Promise<void> {
  await send(`/v1/volumes/${encodeURIComponent(id)}`, { method: 'DELETE' });
}

export function histogramOf(id: string, bins: number, signal?: AbortSignal): Promise<Histogram> {
  return json(`/v1/volumes/${encodeURIComponent(id)}/histogram?bins=${bins}`, { signal });
}

export function labelsOf(id: string, background: number, signal?: AbortSignal): Promise<VolumeLabels> {
  return json(`/v1/volumes/${encodeURIComponent(id)}/labels?background=${background}`, { signal });
}

// What a job with these parameters would make.
export function estimateOf(query: URLSearchParams, signal?: AbortSignal): Promise<Estimate> {
  return json(`/v1/estimate?${query.toString()}`, { signal });
}

export async function slicePicture(
  id: string,
  axis: Axis,
  index: number,
  window: [number, number],
  signal?: AbortSignal,
): Promise<Blob> {
  const query = `axis=${axis}&index=${index}&window=${window[0]},${window[1]}`;
  const path = `/v1/volumes/${encodeURIComponent(id)}/slice.png?${query}`;
  return (await send(path, { signal })).blob();
}

// The volume, reduced to at most that many samples along each axis, as NRRD.
export async function previewFile(
  id: string,
  size: number,
  window: [number, number],
  signal?: AbortSignal,
): Promise<ArrayBuffer> {
  const path = `/v1/volumes/${encodeURIComponent(id)}/preview?size=${size}&window=${window[0]},${window[1]}`;
  return (await send(path, { signal })).arrayBuffer();
}

export function listJobs(cursor = ''): Promise<JobList> {
  return json(`/v1/jobs${cursor === '' ? '' : `?cursor=${encodeURIComponent(cursor)}`}`);
}

export function getJob(id: string, waitSeconds = 0, signal?: AbortSignal): Promise<Job> {
  const query = waitSeconds > 0 ? `?wait=${waitSeconds}` : '';
  return json(`/v1/jobs/${encodeURIComponent(id)}${query}`, { signal });
}

// Not randomUUID, which browsers only have behind TLS.
function randomKey(): string {
  return [...crypto.getRandomValues(new Uint8Array(16))]
    .map((byte) => byte.toString(16).padStart(2, '0'))
    .join('');
}

const submitRetries = 3;

// Called with each job that this page has submitted.
export const submitted = new Signal<string>('');

// The key makes trying again safe: when only the answer was lost, it is the same job.
export async function submitJob(request: JobRequest): Promise<Job> {
  const key = randomKey();
  for (let attempt = 1; ; attempt += 1) {
    try {
      const job = await json<Job>('/v1/jobs', {
        method: 'POST',
        headers: { 'Content-Type': 'application/json', 'Idempotency-Key': key },
        body: JSON.stringify(request),
      });
      submitted.value = job.id;
      return job;
    } catch (error) {
      if (attempt > submitRetries || !asApiError(error).isUnreachable) throw error;
      await new Promise((resolve) => setTimeout(resolve, 500 * attempt));
    }
  }
}

export function cancelJob(id: string): Promise<Job> {
  return json(`/v1/jobs/${encodeURIComponent(id)}`, { method: 'DELETE' });
}

// The bytes of a finished job's mesh in one of its formats.
export async function meshOf(job: Job, format: MeshFormat, signal?: AbortSignal): Promise<ArrayBuffer> {
  const file = job.mesh?.files[format];
  if (!file) throw new RangeError(`job ${job.id} has no file of the format ${format}`);
  return (await send(file.href, { signal })).arrayBuffer();
}

export async function isAlive(): Promise<boolean> {
  try {
    return (await fetch(addressOf('/livez'), { cache: 'no-store' })).ok;
  } catch {
    return false;
  }
}
