// A job's way to its end: the event stream where the daemon has one, else asking again and again. A
// lost connection is waited for.
import { getJob, send } from './client';
import { EventParser } from './events';
import { ApiError, asApiError } from './problem';
import { isFinal, type Job } from './types';

const retryDelays = [500, 1000, 2000, 4000];

function sleep(milliseconds: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, milliseconds);
    signal.addEventListener('abort', () => {
      clearTimeout(timer);
      resolve();
    });
  });
}

// What an event adds to the job: stages and progress come as a few members of it.
export function merged(job: Job, data: string): Job {
  const value: unknown = JSON.parse(data);
  if (typeof value !== 'object' || value === null) return job;
  const change = value as Partial<Job> & { job?: Job };
  const patch = change.job ?? change;
  return patch.id !== undefined && patch.id !== job.id ? job : { ...job, ...patch };
}

// Follows the stream until it ends. False when the daemon has none.
async function followEvents(
  job: Job,
  signal: AbortSignal,
  onChange: (job: Job) => void,
): Promise<boolean> {
  let answer: Response;
  try {
    answer = await send(`/v1/jobs/${job.id}/events`, {
      signal,
      headers: { Accept: 'text/event-stream' },
    });
  } catch (error) {
    const refusal = asApiError(error);
    // The daemon has no stream, or none to spare: asking again and again does as well.
    if ([404, 405, 406, 429, 503].includes(refusal.status)) return false;
    throw error;
  }
  if (!answer.body || !answer.headers.get('Content-Type')?.startsWith('text/event-stream')) return false;
  const parser = new EventParser();
  const decoder = new TextDecoder();
  const reader = answer.body.getReader();
  let current = job;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return true;
    for (const event of parser.take(decoder.decode(value, { stream: true }))) {
      current = merged(current, event.data);
      if (event.name !== 'done') onChange(current);
    }
  }
}

// Calls back with every change, the end included, and resolves with the job as it ended. Throws
// ApiError when the job is gone.
export async function follow(
  id: string,
  signal: AbortSignal,
  onChange: (job: Job) => void,
): Promise<Job> {
  let failures = 0;
  let streams = true;
  while (!signal.aborted) {
    try {
      let job = await getJob(id, 0, signal);
      onChange(job);
      failures = 0;
      while (!isFinal(job.state) && !signal.aborted) {
        if (streams) streams = await followEvents(job, signal, onChange);
        // A job that is done answers at once; otherwise its progress is a second old at most.
        job = await getJob(id, 1, signal);
        onChange(job);
      }
      if (isFinal(job.state)) return job;
    } catch (error) {
      if (signal.aborted) break;
      const refusal = asApiError(error);
      if (!refusal.isUnreachable && refusal.status !== 503 && refusal.status !== 429) throw refusal;
      await sleep(retryDelays[Math.min(failures, retryDelays.length - 1)] ?? 1000, signal);
      failures += 1;
    }
  }
  throw new ApiError(-1, 'Stopped', 'The page does not look at this job any more.');
}
