// What the daemon answers and is asked, by the names that the page uses. The types themselves are made of
// proto/openapi.yaml (generate.mjs).
import type { components, operations } from '../../generated/api';

type Schemas = components['schemas'];

export type Vec3 = Schemas['Vector'];
export type SampleType = Schemas['SampleType'];
export type Volume = Schemas['Volume'];
export type VolumeList = Schemas['VolumeList'];
export type Histogram = Schemas['Histogram'];
export type Axis = NonNullable<NonNullable<operations['getSlice']['parameters']['query']>['axis']>;

export type Estimate = Schemas['Estimate'];
export type MeshFormat = Schemas['MeshFormat'];
export type Priority = Schemas['Priority'];
export type JobRequest = Schemas['JobRequest'];
export type Job = Schemas['Job'];
export type JobList = Schemas['JobList'];
export type JobChange = Schemas['AnyJobEvent'];
// All of them, as a job has them; a request names only some.
export type JobParameters = Job['parameters'];
export type JobState = Schemas['JobState'];

export type Order = Omit<Schemas['Order'], 'parameters'> & { parameters: Partial<JobParameters> };
export type OrderList = Omit<Schemas['OrderList'], 'orders'> & { orders: Order[] };
export type OrderState = Schemas['OrderState'];
export type PacsList = Schemas['PacsList'];

export type MeshSummary = Schemas['MeshSummary'];
export type LabelSummary = Schemas['LabelSummary'];
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

export function isFinal(state: JobState): boolean {
  return state === 'succeeded' || state === 'failed' || state === 'cancelled';
}
