// The types of requests and responses. generate.mjs makes them from proto/openapi.yaml.
import type { components, operations } from '../../generated/api';

type Schemas = components['schemas'];

export type Login = Schemas['Login'];
export type LoginProvider = Schemas['LoginProvider'];

// The type of a global class, from the "dom" library or @types/node. A project with neither gets `Otherwise`, so that
// it can compile the module's types, too.
type Global<Name extends string, Otherwise> = typeof globalThis extends Record<Name, { prototype: infer Instance }>
  ? Instance
  : Otherwise;

export type GlobalAbortSignal = Global<'AbortSignal', { readonly aborted: boolean; readonly reason: unknown }>;
export type GlobalBlob = Global<'Blob', { readonly size: number; arrayBuffer(): Promise<ArrayBuffer> }>;
export type GlobalURLSearchParams = Global<'URLSearchParams', { toString(): string }>;

export interface ClientOptions {
  /** The server's address, such as http://127.0.0.1:8080. */
  server?: string;
  /** The access token, if the server requires one. */
  token?: string;
  /** How long a request waits for a busy server (429 or 503), in seconds. The default is 600. With 0 it fails at once. */
  retrySeconds?: number;
}

export type Vec3 = Schemas['Vector'];
export type SampleType = Schemas['SampleType'];
export type Volume = Schemas['Volume'];
// A string if it has too many digits for a number.
export type Label = Schemas['Label'];
export type VolumeList = Schemas['VolumeList'];
export type Histogram = Schemas['Histogram'];
export type Axis = NonNullable<NonNullable<operations['getSlice']['parameters']['query']>['axis']>;

export type Estimate = Schemas['Estimate'];
export type MeshFormat = Schemas['MeshFormat'];
export type Priority = Schemas['Priority'];
export type JobRequest = Schemas['JobRequest'];
export type Job = Schemas['Job'];
export type JobList = Schemas['JobList'];
export type JobReport = Schemas['JobReport'];
export type JobChange = Schemas['AnyJobEvent'];
// All parameters, as a job has them. A request may name only some.
export type JobParameters = Job['parameters'];
export type JobState = Schemas['JobState'];

export type Order = Omit<Schemas['Order'], 'parameters'> & { parameters: Partial<JobParameters> };
export type OrderList = Omit<Schemas['OrderList'], 'orders'> & { orders: Order[] };
export type OrderState = Schemas['OrderState'];
export type PacsList = Schemas['PacsList'];
export type PacsSeries = Schemas['PacsSeries'];
export type PacsSeriesList = Schemas['PacsSeriesList'];

export type MeshSummary = Schemas['MeshSummary'];
export type LabelSummary = Schemas['LabelSummary'];
export type LabelSummaryList = Schemas['LabelSummaryList'];
export type WallSummary = Schemas['WallSummary'];
export type WallList = Schemas['WallList'];
export type VolumeLabels = Schemas['VolumeLabels'];
export type VolumeLabel = Schemas['VolumeLabel'];
export type DistanceSummary = Schemas['DistanceSummary'];
export type MeshFile = Schemas['MeshFile'];
export type Distribution = Schemas['Distribution'];
export type QualityStages = Schemas['QualityStages'];

export type Problem = Schemas['Problem'];
export type FieldFault = NonNullable<Problem['errors']>[number];

export type Choice = NonNullable<Problem['choices']>[number];
export type UploadedVolume = Schemas['UploadedVolumes']['volumes'][number];

export interface RawDescription {
  dims: [number, number, number];
  type: SampleType;
  spacing: [number, number, number];
  byteOrder: 'little' | 'big';
}

export interface UploadOptions {
  /** Describes raw samples. A file of a known format needs no description. */
  raw?: RawDescription;
  /** Further query parameters of POST /v1/volumes, such as { series: '1.2.3' } or { accept: 'CODE' }. */
  choices?: Readonly<Record<string, string>>;
  /** The file's name. */
  name?: string;
  /** Names an earlier upload that the server still keeps (`kept` of Uploaded or ApiError). Its bytes are not sent again. */
  kept?: string;
  signal?: GlobalAbortSignal;
  /** Bytes sent so far. All of them are sent while the server reads the volume. */
  onProgress?: (sent: number, total: number) => void;
  /** The server is busy. The request that it refused is sent again after so many seconds. */
  onBusy?: (seconds: number) => void;
}

export interface Uploaded {
  /** One entry for each volume of the file or archive. */
  volumes: UploadedVolume[];
  /** The server keeps the upload under this name while a choice is open. */
  kept?: string;
}

export function isFinal(state: JobState | OrderState): boolean {
  return state === 'succeeded' || state === 'failed' || state === 'cancelled';
}
