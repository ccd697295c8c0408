// The table of a job's parameters, which generate.mjs makes of proto/openapi.yaml. What the page keeps,
// shows, sends and writes of a parameter follows from its row here.
import { parameters as all } from '../../generated/parameters';
import type { JobParameters, MeshFormat, Priority } from '../api/types';

export type Value = string | number | boolean | readonly string[] | null;

export interface Parameter {
  // Where it stands in a job: passes, draco.speed.
  name: string;
  kind: 'number' | 'integer' | 'switch' | 'choice' | 'choices' | 'text';
  title: string;
  help: string;
  unit: string;
  // What a query and an option of the command call it.
  query: string;
  option: string;
  isNullable: boolean;
  // Undefined when every request has to give the parameter.
  default?: Value;
  // Of a choice.
  values?: readonly (string | number)[];
  valueHelp?: Readonly<Record<string, string>>;
  // Of a number.
  minimum?: number;
  above?: number;
  maximum?: number;
  // The parameter is only for jobs in which the other one has a value that is among the cases; what the
  // case says replaces what stands above.
  by?: { parameter: string; cases: Readonly<Record<string, { default?: number; maximum?: number }>> };
}

// Whom to call when a job ends is for programs, and the address may hold a secret: the page neither asks
// for it nor repeats it.
const forPrograms = ['callback.url'];

export const parameters = all.filter(({ name }) => !forPrograms.includes(name));

export function parameterOf(name: string): Parameter {
  const found = parameters.find((parameter) => parameter.name === name);
  if (!found) throw new Error(`proto/openapi.yaml has no job parameter ${name}`);
  return found;
}

function valuesOf<T extends string>(name: string): readonly T[] {
  return (parameterOf(name).values ?? []) as readonly T[];
}

// In the order in which the daemon takes them.
export const priorities = valuesOf<Priority>('priority');
// GLB first: it is what the page shows.
export const meshFormats: readonly MeshFormat[] = [
  'glb',
  ...valuesOf<MeshFormat>('formats').filter((format) => format !== 'glb'),
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

function caseOf({ by }: Parameter, job: JobParameters): { default?: number; maximum?: number } | undefined {
  return by ? by.cases[String(valueIn(job, parameterOf(by.parameter)))] : {};
}

// Whether the parameter is for such a job.
export function applies(parameter: Parameter, job: JobParameters): boolean {
  return caseOf(parameter, job) !== undefined;
}

export function maximumOf(parameter: Parameter, job: JobParameters): number | undefined {
  return caseOf(parameter, job)?.maximum ?? parameter.maximum;
}

// What the daemon takes when such a job does not say it; null: no limit.
export function defaultOf(parameter: Parameter, job: JobParameters): Value | undefined {
  return caseOf(parameter, job)?.default ?? parameter.default;
}

function isWithin(parameter: Parameter, value: number, job: JobParameters): boolean {
  const { minimum = -Infinity, above = -Infinity } = parameter;
  return value >= minimum && value > above && value <= (maximumOf(parameter, job) ?? Infinity);
}

// Whether the daemon takes that value of the parameter in such a job.
export function fits(parameter: Parameter, value: Value, job: JobParameters): boolean {
  const { kind, values = [] } = parameter;
  if (value === null) return parameter.isNullable;
  switch (kind) {
    case 'number':
      return Number.isFinite(value) && isWithin(parameter, value as number, job);
    case 'integer':
      return Number.isInteger(value) && isWithin(parameter, value as number, job);
    case 'switch':
      return typeof value === 'boolean';
    case 'choice':
      return values.includes(value as string | number);
    case 'choices':
      return Array.isArray(value) && value.length > 0 && value.every((one) => values.includes(one as string));
    case 'text':
      return typeof value === 'string';
  }
}

// Whether the daemon takes that value without being told.
export function isDefault(parameter: Parameter, job: JobParameters): boolean {
  const value = JSON.stringify(valueIn(job, parameter) ?? null);
  return [parameter.default, defaultOf(parameter, job)].some(
    (standard) => standard !== undefined && JSON.stringify(standard) === value,
  );
}
