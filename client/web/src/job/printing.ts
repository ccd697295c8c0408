// A surface for a 3D printer, and its measurements.
import type { Job, JobParameters } from '../api/types';
import { variantOf, withGlb } from './parameters';
import { applies, parameterOf } from './table';

const printers: readonly string[] = ['stl', '3mf'];
// In millimetres: about a layer of a printer, beyond which nobody sees the difference.
const layer = 0.2;
// The width of the usual nozzle: printers leave out walls that are thinner.
export const nozzle = 0.4;

// The largest error of a print: half a voxel, but no more than a layer.
export function printingError(spacing: readonly number[]): number {
  return Number(Math.min(layer, Math.min(...spacing) / 2).toPrecision(2));
}

// One closed component without cavities, smoothed so that it keeps its volume, within a proven error. Labels keep their components
// and their own smoothing.
export function forPrinting(job: JobParameters, spacing: readonly number[]): JobParameters {
  const changes: Partial<JobParameters> = {
    close: true,
    certify: true,
    min_thickness_mm: job.min_thickness_mm ?? nozzle,
    max_error_mm: job.max_error_mm ?? printingError(spacing),
    formats: withGlb([...job.formats, 'stl', '3mf']),
    components: { ...job.components, keep: job.components?.keep ?? 1 },
    fill_cavities: true,
    ...(job.smoothing === 'laplacian' && { smoothing: 'taubin' }),
  };
  return variantOf(job, ofKind(job, changes));
}

// Takes back what a print needs.
export function notForPrinting(job: JobParameters, spacing: readonly number[]): JobParameters {
  const changes: Partial<JobParameters> = {
    close: false,
    certify: false,
    ...(job.min_thickness_mm === nozzle && { min_thickness_mm: null }),
    formats: withGlb(job.formats.filter((format) => !printers.includes(format))),
    fill_cavities: false,
    ...(job.components?.keep === 1 && { components: { ...job.components, keep: null } }),
    ...(job.max_error_mm === printingError(spacing) && { max_error_mm: null }),
    ...(job.smoothing === 'taubin' && { smoothing: 'laplacian' }),
  };
  return variantOf(job, ofKind(job, changes));
}

// Those that the daemon takes for this kind of job.
function ofKind(job: JobParameters, changes: Partial<JobParameters>): Partial<JobParameters> {
  const takes = (name: string): boolean => applies(parameterOf(name === 'components' ? 'components.keep' : name), job);
  return Object.fromEntries(Object.entries(changes).filter(([name]) => takes(name)));
}

// True if the job was asked for what a printer needs.
export function isForPrinter({ formats, certify }: JobParameters): boolean {
  return certify === true && printers.every((format) => formats.some((one) => one === format));
}

// True if it came out with an inside, too.
export function isForPrinting({ parameters, mesh }: Job): boolean {
  return isForPrinter(parameters) && (mesh?.quality.encloses_volume ?? false);
}
