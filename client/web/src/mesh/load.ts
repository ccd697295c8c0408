// A finished job's mesh, part by part: downloaded, decoded in workers, and handed over as it comes.
import { client, connected } from '../client';
import { ApiError, asApiError, unreachable } from '../api/problem';
import { sleep } from '../api/sleep';
import type { Job, MeshFile } from '../api/types';
import type { Block } from './blocks';
import { GlbReader, type Part, type Primitive } from './glb';
import { decoders } from './pool';
import { viewableFile } from './shown';

export interface LoadProgress {
  bytes: number;
  totalBytes: number;
  // The number in all blocks. It exceeds that of the mesh for labels, because two labels share a wall.
  totalTriangles: number;
}

export interface LoadTiming {
  download: number;
  decode: number;
}

export interface LoadListener {
  // Of one label, or of the only surface; of the coarsest level of detail, or of the finest.
  onBlocks: (blocks: Block[], part: Part | null, isCoarse: boolean) => void;
  onProgress: (progress: LoadProgress) => void;
}

const mostResumes = 5;
const resumeDelay = 1000;

// Waits until somebody answers again, however long that takes.
function reconnected(signal: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    if (connected.value) {
      resolve();
      return;
    }
    const stop = connected.subscribe((isConnected) => {
      if (!isConnected) return;
      stop();
      resolve();
    });
    signal.addEventListener('abort', () => {
      stop();
      reject(new DOMException('No longer wanted', 'AbortError'));
    });
  });
}

// Hands over the file's bytes in order. A connection that is lost is taken up where it broke.
async function download(
  file: MeshFile,
  signal: AbortSignal,
  take: (piece: Uint8Array) => void,
): Promise<void> {
  let received = 0;
  let resumes = 0;
  while (received < file.bytes) {
    const before = received;
    try {
      const range: Record<string, string> =
        received > 0 ? { Range: `bytes=${received}-`, 'If-Range': `"${file.sha256}"` } : {};
      const answer = await client.connection.send(file.href, { signal, headers: range });
      if (received > 0 && answer.status !== 206) {
        throw new ApiError(-1, 'The mesh changed', 'The file has changed on the server. Reload the page.');
      }
      const reader = answer.body?.getReader();
      if (!reader) throw unreachable();
      for (;;) {
        const { done, value } = await reader.read();
        if (done) break;
        received += value.length;
        take(value);
      }
      if (received < file.bytes) throw unreachable();
    } catch (error) {
      if (signal.aborted) throw error;
      const failure = asApiError(error);
      resumes = received > before ? 1 : resumes + 1;
      if (!failure.isUnreachable || resumes > mostResumes) throw failure;
      connected.value = false;
      await sleep(resumeDelay * resumes);
      await reconnected(signal);
    }
  }
}

export async function loadMesh(
  job: Job,
  signal: AbortSignal,
  listener: LoadListener,
): Promise<LoadTiming> {
  const viewable = viewableFile(job);
  if (!viewable) throw new Error('The job has no file that the page can show.');
  const { file, format } = viewable;
  const progress: LoadProgress = {
    bytes: 0,
    totalBytes: file.bytes,
    totalTriangles: job.mesh?.triangles ?? 0,
  };
  const began = performance.now();
  const decoding: Promise<void>[] = [];
  const decode = (bytes: Uint8Array<ArrayBuffer>, primitive: Primitive | undefined): void => {
    const { arrays, positionId = null, distanceId = null, part = null, isCoarse = false } = primitive ?? {};
    const done = decoders.decode(bytes, { arrays, positionId, distanceId, hasCreases: part !== null }, signal).then((blocks) => {
      if (signal.aborted) return;
      listener.onBlocks(blocks, part, isCoarse);
    });
    // Awaited with the others once all bytes are here. Without a handler until then, the browser would
    // report a failure as one that nobody handles.
    done.catch(() => undefined);
    decoding.push(done);
  };

  if (format === 'glb') {
    let primitives: Primitive[] = [];
    const reader = new GlbReader({
      onPrimitives: (all) => {
        primitives = all;
        progress.totalTriangles = all.reduce((sum, { triangles, isCoarse }) => sum + (isCoarse ? 0 : triangles), 0);
      },
      onStream: (index, bytes) => decode(bytes, primitives[index]),
    });
    await download(file, signal, (piece) => {
      reader.take(piece);
      progress.bytes += piece.length;
      listener.onProgress({ ...progress });
    });
    if (!reader.isComplete) throw new Error('The GLB file ends too early.');
  } else {
    const whole = new Uint8Array(file.bytes);
    await download(file, signal, (piece) => {
      whole.set(piece, progress.bytes);
      progress.bytes += piece.length;
      listener.onProgress({ ...progress });
    });
    decode(whole, undefined);
  }
  const downloaded = performance.now();
  await Promise.all(decoding);
  return { download: downloaded - began, decode: performance.now() - downloaded };
}
