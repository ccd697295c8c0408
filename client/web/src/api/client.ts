// The daemon's routes as functions. Failures are thrown as ApiError.
import { asApiError, errorOf } from './problem';
import { Signal } from '../ui/signal';
import type { Axis, Estimate, Histogram, Job, JobList, JobRequest, Volume, VolumeLabels, VolumeList } from './types';

const tokenKey = 'isomesh.token';
const volumesPerPage = 60;

// The token that requests carry; empty without one. It lives as long as the tab.
export const token = new Signal<string>(sessionStorage.getItem(tokenKey) ?? '');
token.subscribe((value) => {
  if (value === '') sessionStorage.removeItem(tokenKey);
  else sessionStorage.setItem(tokenKey, value);
});

// Whether the last request got through.
export const connected = new Signal<boolean>(true);
// Whether the daemon wants a token that we do not have.
export const unauthorized = new Signal<boolean>(false);

export function headers(more: Record<string, string> = {}): Record<string, string> {
  return token.value === '' ? more : { ...more, Authorization: `Bearer ${token.value}` };
}

export async function send(path: string, init: RequestInit = {}): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path, { ...init, headers: headers(init.headers as Record<string, string>) });
  } catch (error) {
    if (error instanceof DOMException && error.name === 'AbortError') throw error;
    connected.value = false;
    throw asApiError(error);
  }
  connected.value = true;
  if (!answer.ok) {
    const error = errorOf(answer.status, await answer.text());
    if (error.status === 401) unauthorized.value = true;
    throw error;
  }
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

export async function isAlive(): Promise<boolean> {
  try {
    return (await fetch('/livez', { cache: 'no-store' })).ok;
  } catch {
    return false;
  }
}
