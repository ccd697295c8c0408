// A job's parameters as the page keeps them, in the form and in addresses, and as it sends them.
import type { JobParameters, JobRequest, Label, MeshFormat } from '../api/types';
import { formatIso } from '../ui/format';
import {
  applies,
  asText,
  fits,
  holdsAllLabels,
  isByLabels,
  isDefault,
  meshFormats,
  parameterOf,
  parameters,
  valueIn,
  withLabels,
  withValue,
  type Parameter,
  type Value,
} from './table';

// The daemon's defaults, but for the format: GLB is what the page shows.
export function defaultParameters(volume: string, iso: number): JobParameters {
  const given: Partial<JobParameters> = { volume, iso, formats: ['glb'] };
  return parameters
    .filter(({ name, default: standard }) => !(name in given) && standard !== undefined)
    .reduce((job, parameter) => withValue(job, parameter, parameter.default ?? null), given) as JobParameters;
}

// The job with another value of that parameter. What depends on the parameter (the step of a pass, on
// the kind of smoothing) gets its default again: a value for the one case means something else, or is
// refused, in the other.
export function changed(job: JobParameters, parameter: Parameter, value: Value): JobParameters {
  const next = withValue(job, parameter, value);
  if (valueIn(job, parameter) === value) return next;
  return parameters
    .filter(({ by }) => by?.parameter === parameter.name)
    .reduce((result, dependent) => withValue(result, dependent, dependent.default ?? null), next);
}

// The same for several, one after the other; of a group (components) for each of its members.
export function variantOf(job: JobParameters, changes: Partial<JobParameters>): JobParameters {
  const each = Object.entries(changes).flatMap(([name, value]): [string, unknown][] =>
    parameters.some((one) => one.name === name)
      ? [[name, value]]
      : Object.entries(value as object).map(([member, inner]) => [`${name}.${member}`, inner]),
  );
  return each.reduce(
    (result, [name, value]) => changed(result, parameterOf(name), value as Value),
    job,
  );
}

export function withGlb(formats: readonly MeshFormat[]): JobParameters['formats'] {
  return ['glb', ...meshFormats.filter((format) => format !== 'glb' && formats.includes(format))];
}

export function isShownCodec(codec: unknown): boolean {
  return codec === 'draco' || codec === 'none';
}

// The files that the page can show.
export const shownFiles = 'GLB with the codec draco or none, and Draco in LPS';

// Changes that give the job a GLB file that the page can show.
export function withShownGlb({ formats, glb_codec: codec = 'draco' }: JobParameters): Partial<JobParameters> {
  return { formats: withGlb(formats), glb_codec: isShownCodec(codec) ? codec : 'draco' };
}

// The last part of its name, which no other parameter has.
function addressName({ name }: Parameter): string {
  return name.split('.').at(-1) ?? name;
}

function fromJson(text: string): Value {
  try {
    return JSON.parse(text) as Value;
  } catch {
    return null;
  }
}

// Each three numbers are one place.
function placesFrom(text: string): number[][] {
  const numbers = numbersFrom(text);
  return Array.from({ length: Math.ceil(numbers.length / 3) }, (_, n) => numbers.slice(3 * n, 3 * n + 3));
}

function numbersFrom(text: string): number[] {
  return text.split(',').map(Number);
}

// One with too many digits for a number stays as it is.
export function labelFrom(text: string): Label {
  const number = Number(text);
  return Number.isInteger(number) && !Number.isSafeInteger(number) ? text : number;
}

const readers: Record<Parameter['kind'], (text: string, values: Parameter['values']) => Value> = {
  number: Number,
  integer: Number,
  switch: (text) => text === 'true',
  choice: (text, values) => values?.find((value) => String(value) === text) ?? text,
  choices: (text, values) => text.split(',').filter((one) => values?.includes(one)),
  text: String,
  labels: (text) => (text === 'all' ? text : text.split(',').map(labelFrom)),
  numbers: numbersFrom,
  places: placesFrom,
  'by label': fromJson,
};

export function fromText({ kind, values }: Parameter, text: string): Value {
  return readers[kind](text, values);
}

// Takes over what the query says and is valid; a link that was typed wrongly does no harm.
export function parametersOfQuery(query: URLSearchParams, defaults: JobParameters): JobParameters {
  const take = (job: JobParameters, parameter: Parameter): JobParameters => {
    const text = query.get(addressName(parameter))?.trim() ?? '';
    const value = fromText(parameter, text);
    return text !== '' && fits(parameter, value, job) ? withValue(job, parameter, value) : job;
  };
  // Parameters that depend on another one are checked after it.
  const labels = parameters.find(({ kind }) => kind === 'labels');
  const start = labels ? withLabels(defaults, take(defaults, labels).labels) : defaults;
  const inAddress = parameters.filter(({ name }) => name !== 'volume');
  const job = [...inAddress.filter(({ by }) => !by), ...inAddress.filter(({ by }) => by)].reduce(take, start);
  return { ...job, formats: withGlb(job.formats) };
}

// The parameters that differ from the defaults, as texts for a query; '' for all others.
export function queryOfParameters(job: JobParameters, defaults: JobParameters): Record<string, string> {
  const textOf = (parameter: Parameter): string => {
    const text = asText(valueIn(job, parameter));
    if (parameter.name === 'iso') return isByLabels(job) ? '' : text;
    if (parameter.name === 'formats') return text === asText(defaults.formats) ? '' : text;
    return applies(parameter, job) && !isDefault(parameter, job) ? text : '';
  };
  return Object.fromEntries(
    parameters
      .filter(({ name }) => name !== 'volume')
      .map((parameter) => [addressName(parameter), textOf(parameter)]),
  );
}

const alwaysSaid = ['volume', 'iso', 'labels', 'formats'];

// The parameters that a request has to name: those that are not the daemon's defaults.
export function toSay(job: JobParameters): Parameter[] {
  return parameters.filter(
    (parameter) =>
      applies(parameter, job) &&
      valueIn(job, parameter) !== undefined &&
      (alwaysSaid.includes(parameter.name) || !isDefault(parameter, job)),
  );
}

// The body of the request for that job.
export function jobRequest(job: JobParameters): JobRequest {
  return toSay(job).reduce(
    (request, parameter) => withValue(request, parameter, valueIn(job, parameter) ?? null),
    {} as Partial<JobParameters>,
  ) as JobRequest;
}

// The same as the query of an estimate.
export function estimateQuery(job: JobParameters): URLSearchParams {
  return new URLSearchParams(
    toSay(job).filter(({ kind }) => kind !== 'by label').map((parameter) => [parameter.query, asText(valueIn(job, parameter))]),
  );
}

export function isSameJob(a: JobParameters, b: JobParameters): boolean {
  return JSON.stringify(jobRequest(a)) === JSON.stringify(jobRequest(b));
}

// The files that the job makes.
export function filesOf({ labels, formats }: JobParameters): MeshFormat[] {
  if (labels === undefined) return [...formats];
  const whole = formats.filter(holdsAllLabels);
  return whole.length < formats.length ? [...whole, 'zip'] : whole;
}

// The surface in words: iso 60, all labels.
export function surfaceInWords({ inside, iso, labels }: Partial<JobParameters>): string {
  if (labels === undefined) return `${inside === 'below' ? 'below ' : ''}iso ${formatIso(iso ?? 'otsu')}`;
  if (labels === 'all') return 'all labels';
  const [only] = labels;
  return labels.length === 1 ? `label ${only}` : `${labels.length} labels`;
}

// The same for the names of files, in ASCII: iso-1250. The page's own texts have a minus sign and thin spaces in numbers.
export function surfaceInNames(job: Partial<JobParameters>): string {
  return surfaceInWords(job).replaceAll('\u2212', '-').replaceAll('\u202f', '').replaceAll(' ', '-');
}

const lattices = { 5: '5 tetrahedra', 6: '6 tetrahedra', fcc: 'face-centred lattice', kuhn: 'primitive lattice', bcc: 'body-centred lattice' };

export function schemeInWords({ scheme }: Pick<JobParameters, 'scheme'>): string {
  return lattices[scheme];
}

// In a few words, for titles: 6 tetrahedra, linear, 5 passes.
export function inWords(job: JobParameters): string {
  if (job.smoothing === 'labels') {
    return `${schemeInWords(job)}, ${job.passes > 0 ? 'without steps' : 'not smoothed'}${job.close ? ', closed' : ''}`;
  }
  const passes = job.passes === 1 ? '1 pass' : `${job.passes} passes`;
  const smoothing = job.smoothing !== 'laplacian' && job.passes > 0 ? ` (${job.smoothing})` : '';
  const closed = job.close ? ', closed' : '';
  const placed = isByLabels(job) ? '' : `, ${job.interpolation}`;
  return `${schemeInWords(job)}${placed}, ${passes}${smoothing}${closed}`;
}
