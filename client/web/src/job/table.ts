// The table of a job's parameters, which generate.mjs makes of proto/openapi.yaml. What the page keeps,
// shows, sends and writes of a parameter follows from its row here.
import { parameters as all, wholeFormats } from '../../generated/parameters';
import type { JobParameters, MeshFormat, Priority } from '../api/types';

// By labels' values.
export type ByLabel = Readonly<Record<string, string | readonly number[]>>;
// A place is x, y and z in millimetres, LPS.
export type Places = readonly (readonly number[])[];
export type Value = string | number | boolean | readonly string[] | readonly (number | string)[] | Places | ByLabel | null;

// Empty for no value.
export function asText(value: Value | undefined): string {
  if (value === undefined || value === null) return '';
  if (typeof value !== 'object') return String(value);
  return Array.isArray(value) ? value.flat().join(',') : JSON.stringify(value);
}

export interface Parameter {
  // Its place in a job: passes, draco.speed.
  name: string;
  kind: 'number' | 'integer' | 'switch' | 'choice' | 'choices' | 'text' | 'labels' | 'by label' | 'numbers' | 'places';
  title: string;
  help: string;
  unit: string;
  // Its name in a query and as an option of the command.
  query: string;
  option: string;
  isNullable: boolean;
  // Undefined when every request has to give the parameter.
  default?: Value;
  // For a choice.
  values?: readonly (string | number)[];
  valueHelp?: Readonly<Record<string, string>>;
  // For a number.
  minimum?: number;
  above?: number;
  maximum?: number;
  // The jobs that take it: those at an iso-value, those by labels, or both; and its default by labels,
  // if that differs.
  jobs: 'iso' | 'labels' | 'any';
  byLabels?: string | number | boolean;
  // The parameter is only for jobs in which the other one has a value that is among the cases; what the
  // case says replaces what stands above.
  by?: { parameter: string; cases: Readonly<Record<string, { default?: number; maximum?: number }>> };
}

// Whom to call when a job ends is for programs, and the address may hold a secret: the page neither asks
// for it nor repeats it.
const forPrograms = ['callback.url'];

export const parameters = all.filter(({ name }) => !forPrograms.includes(name));

export function isByLabels({ labels }: Partial<JobParameters>): boolean {
  return labels !== undefined;
}

export function parameterOf(name: string): Parameter {
  const found = parameters.find((parameter) => parameter.name === name);
  if (!found) throw new Error(`proto/openapi.yaml has no job parameter ${name}`);
  return found;
}

export function valuesOf<T extends string>(name: string): readonly T[] {
  return (parameterOf(name).values ?? []) as readonly T[];
}

// In the order in which the daemon takes them.
export const priorities = valuesOf<Priority>('priority');
// GLB first: it is what the page shows.
// A ZIP is no choice: it comes by itself where a format needs one, as it holds a file of each label.
export const meshFormats: readonly MeshFormat[] = [
  'glb',
  ...valuesOf<MeshFormat>('formats').filter((format) => format !== 'glb' && format !== 'zip'),
];

// A part of a job, by the names of its members.
type Members = Readonly<Record<string, unknown>>;

// Undefined where the job does not say it.
export function valueIn(job: Partial<JobParameters>, { name }: Parameter): Value | undefined {
  const [owner = '', member] = name.split('.');
  const own = (job as Members)[owner];
  return (member === undefined ? own : (own as Members | undefined)?.[member]) as Value | undefined;
}

// The job with that value in its place.
export function withValue<Job extends Partial<JobParameters>>(job: Job, { name }: Parameter, value: Value): Job {
  const [owner = '', member] = name.split('.');
  const inner = (job as Members)[owner] as Members | undefined;
  return { ...job, [owner]: member === undefined ? value : { ...inner, [member]: value } };
}

// The job by those labels, or at its iso-value. What has the default of the one kind, or a choice that the other kind does
// not have, gets the default of the other.
export function withLabels(job: JobParameters, labels: JobParameters['labels']): JobParameters {
  const next = { ...job, labels };
  if (labels === undefined) delete next.labels;
  const isLeft = (parameter: Parameter): boolean => {
    const value = valueIn(job, parameter);
    if (parameter.kind === 'choice' && value !== undefined && !fits(parameter, value, next)) return true;
    return parameter.byLabels !== undefined && value === defaultOf(parameter, job);
  };
  return parameters
    .filter(isLeft)
    .reduce((result, parameter) => withValue(result, parameter, defaultOf(parameter, next) ?? null), next);
}

function caseOf({ by }: Parameter, job: JobParameters): { default?: number; maximum?: number } | undefined {
  return by ? by.cases[asText(valueIn(job, parameterOf(by.parameter)))] : {};
}

// True if the parameter is for this kind of job: at an iso-value or by labels.
export function isOfKind({ jobs }: Parameter, job: JobParameters): boolean {
  return jobs === 'any' || jobs === (isByLabels(job) ? 'labels' : 'iso');
}

// Of schemes that have a number, too.
const secondNames: readonly (string | number)[] = ['fcc', 'kuhn'];

// The choices that the daemon takes for this job: one kind of smoothing is for labels alone, one lattice never for them.
export function choicesOf({ name, values = [] }: Parameter, job: JobParameters): readonly (string | number)[] {
  return values.filter((value) => {
    if (name === 'smoothing' && value === 'labels') return isByLabels(job);
    if (name === 'scheme' && value === 'bcc') return !isByLabels(job);
    return name !== 'scheme' || !secondNames.includes(value) || value === job.scheme;
  });
}

// True if the parameter applies to this job.
export function applies(parameter: Parameter, job: JobParameters): boolean {
  if (!isOfKind(parameter, job)) return false;
  return caseOf(parameter, job) !== undefined;
}

export function maximumOf(parameter: Parameter, job: JobParameters): number | undefined {
  return caseOf(parameter, job)?.maximum ?? parameter.maximum;
}

// The daemon's default for this job; null: no limit.
export function defaultOf(parameter: Parameter, job: JobParameters): Value | undefined {
  const forThese = isByLabels(job) ? parameter.byLabels : undefined;
  if (forThese !== undefined) return forThese;
  return caseOf(parameter, job)?.default ?? parameter.default;
}

function isWithin(parameter: Parameter, value: number, job: JobParameters): boolean {
  const { minimum = -Infinity, above = -Infinity } = parameter;
  return value >= minimum && value > above && value <= (maximumOf(parameter, job) ?? Infinity);
}

const checks: Record<Parameter['kind'], (value: Value, parameter: Parameter, job: JobParameters) => boolean> = {
  number: (value, parameter, job) => Number.isFinite(value) && isWithin(parameter, value as number, job),
  integer: (value, parameter, job) => Number.isInteger(value) && isWithin(parameter, value as number, job),
  switch: (value) => typeof value === 'boolean',
  choice: (value, parameter, job) => choicesOf(parameter, job).includes(value as string | number),
  choices: (value, { values = [] }) => areSome(value) && value.every((one) => values.includes(one as string)),
  text: (value) => typeof value === 'string',
  labels: (value) => value === 'all' || areLabels(value),
  numbers: (value, parameter, job) => areSome(value) && value.every((one) => Number.isFinite(one) && isWithin(parameter, one as number, job)),
  places: (value) => areSome(value) && value.every((place) => areSome(place) && place.length === 3 && place.every(Number.isFinite)),
  'by label': (value) => value !== null && typeof value === 'object' && Object.entries(value).every(([label, of]) => isOfLabel(label, of)),
};

// True if the daemon accepts this value of the parameter in this job.
export function fits(parameter: Parameter, value: Value, job: JobParameters): boolean {
  return value === null ? parameter.isNullable : checks[parameter.kind](value, parameter, job);
}

function areSome(value: unknown): value is unknown[] {
  return Array.isArray(value) && value.length > 0;
}

function areLabels(value: unknown): boolean {
  return areSome(value) && value.every((one) => Number.isInteger(one) || (typeof one === 'string' && /^-?\d+$/.test(one)));
}

function isOfLabel(label: string, value: unknown): boolean {
  return /^-?\d+$/.test(label) && (typeof value === 'string' || areLabels(value));
}

// True if the value is the daemon's default.
export function isDefault(parameter: Parameter, job: JobParameters): boolean {
  const own = valueIn(job, parameter);
  if (own === undefined || (own === null && parameter.default === undefined)) return true;
  const value = JSON.stringify(own);
  // Null leaves it to the daemon, whatever the job is.
  const isOther = isByLabels(job) && parameter.byLabels !== undefined && parameter.default !== null;
  return [isOther ? undefined : parameter.default, defaultOf(parameter, job)].some(
    (standard) => standard !== undefined && JSON.stringify(standard) === value,
  );
}

// True if one file of the format holds all labels. Files of other formats come in a ZIP.
export function holdsAllLabels(format: MeshFormat): boolean {
  return wholeFormats.includes(format);
}
