// One client of one server: the server's routes as methods. A failure is thrown as an ApiError.
import { Connection } from './connection';
import { follow } from './follow';
import { JobEvents } from './job_events';
import { emptySurface, jsonOf, notTheApi } from './problem';
import type {
  Axis,
  ClientOptions,
  Estimate,
  GlobalAbortSignal,
  GlobalBlob,
  GlobalURLSearchParams,
  Histogram,
  Job,
  JobList,
  JobReport,
  JobRequest,
  JobState,
  LabelSummary,
  LabelSummaryList,
  MeshFormat,
  Order,
  OrderList,
  OrderState,
  PacsList,
  PacsSeriesList,
  Uploaded,
  UploadOptions,
  Volume,
  VolumeLabels,
  VolumeList,
  WallList,
  WallSummary,
} from './types';
import { upload } from './upload';

const volumesPerPage = 60;

// A key only has to differ from others, so Math.random will do. Node 18 has no global `crypto`, and browsers have
// randomUUID only behind TLS.
function randomKey(): string {
  return Array.from({ length: 16 }, () => Math.floor(256 * Math.random()).toString(16).padStart(2, '0')).join('');
}

// With its question mark; '' if there is nothing to say.
function queryOf(values: Readonly<Record<string, string | number | undefined>>): string {
  const given = Object.entries(values).filter(([, value]) => value !== undefined && value !== '');
  return given.length === 0 ? '' : `?${new URLSearchParams(given.map(([name, value]) => [name, String(value)])).toString()}`;
}

// All that the pages of a list hold. A page without items is the last.
async function allPages<Page extends { next: string | null }, T>(pageAt: (cursor: string) => Promise<Page>, held: (page: Page) => T[]): Promise<T[]> {
  const all: T[] = [];
  for (let cursor: string | null = ''; cursor !== null; ) {
    const page: Page = await pageAt(cursor);
    const items: unknown = held(page);
    if (!Array.isArray(items)) throw notTheApi();
    all.push(...(items as T[]));
    cursor = items.length > 0 && page.next ? page.next : null;
  }
  return all;
}

function volumePath(id: string): string {
  return `/v1/volumes/${encodeURIComponent(id)}`;
}

function jobPath(id: string): string {
  return `/v1/jobs/${encodeURIComponent(id)}`;
}

function orderPath(id: string): string {
  return `/v1/orders/${encodeURIComponent(id)}`;
}

/** A client of one server. Clients share nothing, so one process can use several servers at once. */
export class Client {
  /** @internal The state of the connection, which the page shows, and requests beside the routes. */
  readonly connection: Connection;
  /** @internal The stream of what happens to jobs. */
  readonly events: JobEvents;

  /** Outside a page `server` is required. On a page it may be left out, which means the server that the page comes from. */
  constructor({ server, token = '', retrySeconds }: ClientOptions = {}) {
    this.connection = new Connection(server, token, retrySeconds);
    this.events = new JobEvents(this.connection);
  }

  // --- Volumes ---

  /**
   * Uploads a file, an archive of files, or raw samples. An upload continues after its connection broke.
   * Rejects with a TypeError if `whole` is something else than bytes, such as a file's name.
   */
  upload(whole: GlobalBlob | ArrayBuffer | ArrayBufferView, options: UploadOptions = {}): Promise<Uploaded> {
    return upload(this.connection, whole, options);
  }

  /** Lists the newest first, in pages of at most 1000. */
  listVolumes(cursor = '', signal?: GlobalAbortSignal, limit = volumesPerPage): Promise<VolumeList> {
    return this.connection.json(`/v1/volumes${queryOf({ order: 'newest', limit, cursor })}`, { signal });
  }

  /** The grid and values of a volume, and what the server decided when it read it. */
  getVolume(id: string): Promise<Volume> {
    return this.connection.json(volumePath(id));
  }

  /** Changes the volume's name, or removes it with null. */
  renameVolume(id: string, name: string | null): Promise<Volume> {
    return this.connection.json(volumePath(id), {
      method: 'PATCH',
      headers: { 'Content-Type': 'application/json' },
      body: JSON.stringify({ name }),
    });
  }

  /**
   * Stores a flipped or turned copy of the volume. `axes` are those whose directions x, y and z get: `-x,y,z` flips
   * along x, `y,-x,z` turns by 90 degrees about z.
   */
  reorientVolume(id: string, axes: string): Promise<Volume> {
    return this.connection.json(`${volumePath(id)}/reoriented${queryOf({ axes })}`, { method: 'POST' });
  }

  /** Erases the volume, and with `jobs: 'erase'` all jobs on it with their files. */
  async eraseVolume(id: string, { jobs }: { jobs?: 'keep' | 'erase' } = {}): Promise<void> {
    await this.connection.send(`${volumePath(id)}${queryOf({ jobs })}`, { method: 'DELETE' });
  }

  /** Counts the samples in `bins` intervals of the same width, from the least value to the greatest. */
  histogramOf(id: string, bins: number, signal?: GlobalAbortSignal): Promise<Histogram> {
    return this.connection.json(`${volumePath(id)}/histogram?bins=${bins}`, { signal });
  }

  /** Lists the labels of a volume in ascending order. Samples with the value `background` belong to none. */
  async labelsOf(id: string, background: number, signal?: GlobalAbortSignal): Promise<VolumeLabels> {
    const pages: VolumeLabels[] = [];
    const pageAt = async (cursor: string): Promise<VolumeLabels> => {
      const page: VolumeLabels = await this.connection.json(`${volumePath(id)}/labels${queryOf({ background, cursor })}`, { signal });
      pages.push(page);
      return page;
    };
    const labels = await allPages(pageAt, (page) => page.labels);
    return { ...(pages[0] as VolumeLabels), labels, next: null };
  }

  /** A slice as PNG; `window` has the values that are black and white. */
  async slicePicture(
    id: string,
    axis: Axis,
    index: number,
    window: [number, number],
    signal?: GlobalAbortSignal,
  ): Promise<GlobalBlob> {
    return this.connection.blob(`${volumePath(id)}/slice.png${queryOf({ axis, index, window: window.join() })}`, { signal });
  }

  /** The samples of a slice in the volume's own type, row by row, little-endian. */
  samplesOfSlice(id: string, axis: Axis, index: number, signal?: GlobalAbortSignal): Promise<ArrayBuffer> {
    return this.connection.bytes(`${volumePath(id)}/slice${queryOf({ axis, index })}`, { signal });
  }

  /** The volume as NRRD, reduced to at most `size` samples along each axis. */
  async previewFile(id: string, size: number, window: [number, number], signal?: GlobalAbortSignal): Promise<ArrayBuffer> {
    return this.connection.bytes(`${volumePath(id)}/preview${queryOf({ size, window: window.join() })}`, { signal });
  }

  // --- Jobs ---

  /** Estimates the mesh that a job with these parameters would make. */
  estimateOf(query: GlobalURLSearchParams, signal?: GlobalAbortSignal): Promise<Estimate> {
    return this.connection.json(`/v1/estimate?${query.toString()}`, { signal });
  }

  /**
   * Retries when the server cannot be reached. Its key makes that safe: if only the response was lost, the retry
   * returns the same job.
   */
  async submitJob(request: JobRequest): Promise<Job> {
    const { status, text, headers } = await this.connection.askAgain('/v1/jobs', {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', 'Idempotency-Key': randomKey() },
      body: JSON.stringify(request),
    });
    return jsonOf(status, text, headers) as Job;
  }

  /**
   * Calls `onChange` with every change of the job, and resolves with the finished job. It waits while the server
   * cannot be reached or is busy. Rejects with an ApiError if the job no longer exists, and with the signal's reason as
   * soon as the signal is aborted.
   */
  follow(id: string, signal?: GlobalAbortSignal, onChange: (job: Job) => void = () => undefined): Promise<Job> {
    return follow(this, id, signal, onChange);
  }

  /** Lists the newest first, in pages of at most 1000: all jobs, or those in one state, on one volume, or of some days. */
  listJobs(cursor = '', filter: { state?: JobState; limit?: number; volume?: string; since?: string; until?: string } = {}): Promise<JobList> {
    return this.connection.json(`/v1/jobs${queryOf({ ...filter, cursor })}`);
  }

  /** Returns at once, or with `waitSeconds` when the job has finished or the time is over. */
  getJob(id: string, waitSeconds = 0, signal?: GlobalAbortSignal): Promise<Job> {
    return this.connection.json(`${jobPath(id)}${queryOf({ wait: waitSeconds || undefined })}`, { signal });
  }

  /** Lists the labels of a finished job in ascending order, also if the job itself has only `labels_count`. */
  labelsOfJob(id: string, signal?: GlobalAbortSignal): Promise<LabelSummary[]> {
    return allPages((cursor) => this.connection.json<LabelSummaryList>(`${jobPath(id)}/labels${queryOf({ cursor })}`, { signal }), ({ labels }) => labels);
  }

  /** The report of a finished job: parameters, measurements, files and how the bound was proven. */
  reportOf(id: string, signal?: GlobalAbortSignal): Promise<JobReport> {
    return this.connection.json(`${jobPath(id)}/report`, { signal });
  }

  /** Lists the areas where two labels of a finished job touch, or one is next to the background, whose `b` is null. With `edgeContacts` also those of pairs that share no face of a voxel. */
  wallsOfJob(id: string, signal?: GlobalAbortSignal, { edgeContacts = false }: { edgeContacts?: boolean } = {}): Promise<WallSummary[]> {
    const query = { edge_contacts: edgeContacts ? 'true' : undefined };
    return allPages((cursor) => this.connection.json<WallList>(`${jobPath(id)}/walls${queryOf({ cursor, ...query })}`, { signal }), ({ walls }) => walls);
  }

  /** Erases a job that has ended, and its files. */
  async eraseJob(id: string): Promise<void> {
    await this.connection.send(jobPath(id), { method: 'DELETE' });
  }

  /** A job that has ended meanwhile stays as it is. */
  cancelJob(id: string): Promise<Job> {
    return this.connection.json(`${jobPath(id)}${queryOf({ erase: 'false' })}`, { method: 'DELETE' });
  }

  /**
   * Downloads a finished job's mesh in one of the formats that the job was asked for. Rejects with a RangeError if the
   * job has no such file. If a format holds one label, a job with several labels has only the `zip`. Rejects with
   * an ApiError with the status 422 if the surface is empty, unless `allowEmpty` is true.
   */
  async meshOf(job: Job, format: MeshFormat, signal?: GlobalAbortSignal, { allowEmpty = false }: { allowEmpty?: boolean } = {}): Promise<ArrayBuffer> {
    if (job.mesh?.empty && !allowEmpty) throw emptySurface(job.mesh);
    const { files = {}, labels = [] } = job.mesh ?? {};
    const file = files[format] ?? (labels.length === 1 ? labels[0]?.files[format] : undefined);
    if (!file) throw new RangeError(`job ${job.id} has no file of the format ${format}`);
    return this.connection.bytes(file.href, { signal });
  }

  // --- Orders of a hospital: only a server with a PACS has these routes ---

  /** Stays the same while the server runs. */
  async hasOrders(): Promise<boolean> {
    return (await this.connection.json<{ orders: boolean }>('/version')).orders;
  }

  /** Each PACS of the server, and when it last answered. */
  listPacs(signal?: GlobalAbortSignal): Promise<PacsList> {
    return this.connection.json('/v1/pacs', { signal });
  }

  /** Searches a PACS for series, the newest first. One of patient, name, date and study is needed; dates are as DICOM writes them. */
  searchPacs(
    pacs: string,
    query: { patient_id?: string; patient_name?: string; date?: string; modality?: string; study?: string; limit?: number },
    signal?: GlobalAbortSignal,
  ): Promise<PacsSeriesList> {
    return this.connection.json(`/v1/pacs/${encodeURIComponent(pacs)}/series${queryOf(query)}`, { signal });
  }

  /** Lists the newest first, in pages. An empty state lists all. */
  listOrders(state: OrderState | '', cursor = '', signal?: GlobalAbortSignal): Promise<OrderList> {
    return this.connection.json(`/v1/orders${queryOf({ state, cursor })}`, { signal });
  }

  /** Orders a mesh of a series by a rule of the server, or by none with its usual parameters. */
  placeOrder(source: { pacs: string; study: string; series: string }, rule?: string): Promise<Order> {
    return this.connection.json('/v1/orders', {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', 'Idempotency-Key': randomKey() },
      body: JSON.stringify({ source, rule }),
    });
  }

  /** An order that has ended meanwhile stays as it is. */
  cancelOrder(id: string): Promise<Order> {
    return this.connection.json(orderPath(id), { method: 'DELETE' });
  }

  /** Starts a failed order again from its beginning. */
  retryOrder(id: string): Promise<Order> {
    return this.connection.json(`${orderPath(id)}/retry`, { method: 'POST' });
  }
}
