// The differences between jobs: the surface that each makes, and the parameters in which they differ.
import type { Job, JobParameters } from '../api/types';
import { formatValue } from '../ui/format';
import { schemeInWords, surfaceInWords } from './parameters';
import { applies, asText, defaultOf, parameters, valueIn, type Parameter, type Value } from './table';

// Shorter than the title and the value.
const words: Record<string, (job: JobParameters) => string> = {
  scheme: schemeInWords,
  interpolation: ({ interpolation }) => interpolation ?? 'midpoint',
  passes: ({ passes }) => (passes === 1 ? '1 pass' : `${passes} passes`),
  smoothing: ({ smoothing }) => smoothing,
  regularize: ({ regularize }) => (regularize === true ? 'regularized' : 'not regularized'),
  close: ({ close }) => (close ? 'closed' : 'open'),
};
// A title begins with the first four; the others do not change the surface.
const besides = ['volume', 'iso', 'inside', 'labels', 'formats', 'priority', 'label_names', 'label_colors'];

function valueInWords({ kind, unit }: Parameter, value: Value): string {
  if (typeof value === 'boolean') return value ? 'yes' : 'no';
  if (typeof value === 'number') return `${formatValue(value)} ${unit}`.trim();
  if (value === null) return kind === 'number' || kind === 'integer' ? 'no limit' : 'none';
  if (kind === 'by label') return Object.keys(value).length === 0 ? 'as in the file' : `set for ${Object.keys(value).join(', ')}`;
  return asText(value).replaceAll(',', ', ');
}

function inWords(parameter: Parameter, job: JobParameters): string {
  const own = words[parameter.name];
  if (own) return own(job);
  const title = parameter.title.charAt(0).toLowerCase() + parameter.title.slice(1);
  return `${title}: ${valueInWords(parameter, valueIn(job, parameter) ?? defaultOf(parameter, job) ?? null)}`;
}

function areDifferent(values: readonly unknown[]): boolean {
  return new Set(values.map((value) => JSON.stringify(value))).size > 1;
}

// A title for each job: the volume's name if `nameOf` is given and there are several volumes, the iso-value or the labels, and
// the parameters in which the jobs differ. A parameter that does not apply to all of them tells nothing.
export function titlesOf(jobs: readonly Job[], nameOf: (volume: string) => string = () => ''): string[] {
  const all = jobs.map((job) => job.parameters);
  const varying = parameters.filter(
    (parameter) =>
      !besides.includes(parameter.name) &&
      all.every((job) => applies(parameter, job)) &&
      areDifferent(all.map((job) => valueIn(job, parameter) ?? null)),
  );
  const areOfSeveral = areDifferent(all.map(({ volume }) => volume));
  return all.map((job) =>
    [areOfSeveral ? nameOf(job.volume) : '', surfaceInWords(job), ...varying.map((parameter) => inWords(parameter, job))]
      .filter(Boolean)
      .join(', '),
  );
}
