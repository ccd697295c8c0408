// Three kinds of surface, for who does not want to know the parameters behind them.
import type { JobParameters } from '../api/types';
import { variantOf } from './parameters';
import { forPrinting, isForPrinter, notForPrinting } from './printing';
import { defaultOf, parameterOf } from './table';

export type Kind = 'scanned' | 'smooth' | 'printing';

export const kinds: readonly { value: Kind; label: string; title: string }[] = [
  { value: 'scanned', label: 'As scanned', title: 'No smoothing: every vertex stays where the samples put it' },
  { value: 'smooth', label: 'Smooth', title: 'Smoothed, so that the steps of the voxels are not seen' },
  { value: 'printing', label: 'For printing', title: 'The largest component, closed and without cavities, within a proven error, also as STL and 3MF' },
];

// The kind that the parameters come nearest to.
export function kindOf(job: JobParameters): Kind {
  if (isForPrinter(job)) return 'printing';
  return job.passes === 0 ? 'scanned' : 'smooth';
}

// Leaves what has nothing to do with the kind as it is. The spacing is the volume's, in millimetres.
export function withKind(job: JobParameters, kind: Kind, spacing: readonly number[]): JobParameters {
  const usual = isForPrinter(job) && kind !== 'printing' ? notForPrinting(job, spacing) : job;
  const smooth = job.passes > 0 ? job.passes : Number(defaultOf(parameterOf('passes'), job) ?? 5);
  const base = variantOf(usual, { passes: kind === 'scanned' ? 0 : smooth });
  return kind === 'printing' ? forPrinting(base, spacing) : base;
}
