// Three kinds of surface, for who does not want to know the parameters behind them.
import type { JobParameters } from '../api/types';
import { variantOf } from './parameters';
import { isForPrinter, printingVariant, usualFormats } from './printing';
import { applies, defaultOf, parameterOf } from './table';

export type Kind = 'scanned' | 'smooth' | 'printing';

export const kinds: readonly { value: Kind; label: string; title: string }[] = [
  { value: 'scanned', label: 'As scanned', title: 'No smoothing: every vertex stays where the samples put it' },
  { value: 'smooth', label: 'Smooth', title: 'Smoothed, so that the steps of the voxels are not seen' },
  { value: 'printing', label: 'For printing', title: 'Smooth and closed, with its error measured, also as STL and 3MF' },
];

// The kind that the parameters come nearest to.
export function kindOf(job: JobParameters): Kind {
  if (isForPrinter(job)) return 'printing';
  return job.passes === 0 ? 'scanned' : 'smooth';
}

// Leaves what has nothing to do with the kind as it is.
export function withKind(job: JobParameters, kind: Kind): JobParameters {
  const passes = parameterOf('passes');
  const smooth = job.passes > 0 ? job.passes : Number(defaultOf(passes, job) ?? 5);
  const base = variantOf(job, { passes: kind === 'scanned' ? 0 : smooth, ...(isForPrinter(job) && usualFormats(job)) });
  if (kind !== 'printing') return base;
  const { close, ...others } = printingVariant(base);
  return variantOf(base, applies(parameterOf('close'), job) ? { close, ...others } : others);
}
