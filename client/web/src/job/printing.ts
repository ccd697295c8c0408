// A surface for a 3D printer, and its measurements.
import type { Job, JobParameters } from '../api/types';
import { withGlb } from './parameters';

// Closed, in the formats of printers, and measured.
export function printingVariant({ formats }: JobParameters): Partial<JobParameters> {
  return { close: true, certify: true, formats: withGlb([...formats, 'stl', '3mf']) };
}

const printers: readonly string[] = ['stl', '3mf'];

// True if the job was asked for what a printer needs.
export function isForPrinter({ formats, certify }: JobParameters): boolean {
  return certify === true && printers.every((format) => formats.some((one) => one === format));
}

// Without what only a printer needs.
export function usualFormats({ formats }: JobParameters): Partial<JobParameters> {
  return { close: false, certify: false, formats: withGlb(formats.filter((format) => !printers.includes(format))) };
}

// True if it came out closed, too.
export function isForPrinting({ parameters, mesh }: Job): boolean {
  return isForPrinter(parameters) && (mesh?.quality.closed ?? false);
}

// The measurements, the files and the parameters, to keep with a print.
export function certificateFile(job: Job): string {
  const { parameters, mesh, finished, id } = job;
  const { certificate, quality, volume_mm3: volume, area_mm2: area, triangles: count, files } = mesh ?? {};
  const sums = Object.fromEntries(Object.entries(files ?? {}).map(([format, { bytes, sha256 }]) => [format, { bytes, sha256 }]));
  const told = { job: id, finished, parameters, triangles: count, volume_mm3: volume, area_mm2: area, certificate, quality, files: sums };
  return `${JSON.stringify(told, null, 2)}\n`;
}
