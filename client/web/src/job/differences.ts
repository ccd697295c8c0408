// The parameters in which jobs differ.
import type { Job, JobParameters } from '../api/types';
import { formatValue } from '../ui/format';
import { surfaceInWords } from './parameters';
import { asText, parameters, valueIn, type Parameter } from './table';

// Shorter than the title and the value.
const words: Record<string, (job: JobParameters) => string> = {
  volume: ({ volume }) => `volume ${volume.slice(0, 8)}`,
  iso: surfaceInWords,
  labels: surfaceInWords,
  scheme: ({ scheme }) => `${scheme} tetrahedra`,
  interpolation: ({ interpolation }) => interpolation ?? 'midpoint',
  passes: ({ passes }) => `${passes} passes`,
  smoothing: ({ smoothing }) => smoothing,
  close: ({ close }) => (close ? 'closed' : 'open'),
};
// These do not change the surface.
const besides = ['formats', 'priority'];

function inWords(parameter: Parameter, job: JobParameters): string {
  const own = words[parameter.name];
  if (own) return own(job);
  const value = valueIn(job, parameter) ?? 'no limit';
  const text = typeof value === 'number' ? `${formatValue(value)} ${parameter.unit}`.trim() : asText(value);
  return `${parameter.title.charAt(0).toLowerCase()}${parameter.title.slice(1)}: ${text}`;
}

// The parameters in which the jobs differ, in words for each job.
export function differences(jobs: readonly Job[]): string[] {
  const varying = parameters.filter(
    (parameter) =>
      !besides.includes(parameter.name) &&
      new Set(jobs.map((job) => JSON.stringify(valueIn(job.parameters, parameter) ?? null))).size > 1,
  );
  return jobs.map((job) =>
    varying.length > 0
      ? [...new Set(varying.map((parameter) => inWords(parameter, job.parameters)))].join(', ')
      : 'the same parameters',
  );
}
