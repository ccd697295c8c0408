// Why a job's surface has no triangle, and what to do about it.
import type { Job, Volume } from '../api/types';
import { formatCount, formatValue } from '../ui/format';
import { isByLabels } from './table';

export function emptyReason({ parameters, mesh }: Job, volume: Pick<Volume, 'range'> | null): string {
  if (isByLabels(parameters)) return 'There is no surface: the labels have no boundary. Choose other labels.';
  const dropped = mesh?.dropped.components ?? 0;
  if (dropped > 0) {
    const parts = dropped === 1 ? 'its only part was' : `all ${formatCount(dropped)} parts were`;
    return `Nothing is left of the surface: ${parts} dropped. Keep more of them.`;
  }
  const iso = mesh?.iso ?? parameters.iso;
  const at = typeof iso === 'number' ? `at the iso-value ${formatValue(iso)}` : 'at this iso-value';
  const where = parameters.crop ? ' within the box' : '';
  if (!volume) return `There is no surface ${at}${where}.`;
  const [low, high] = volume.range;
  const samples = `the volume's samples go from ${formatValue(low)} to ${formatValue(high)}`;
  if (typeof iso === 'number' && (iso <= low || iso > high)) {
    return `There is no surface ${at}: ${samples}. Choose an iso-value between them.`;
  }
  const crop = parameters.crop ? ', or a larger box' : '';
  return `There is no surface ${at}${where}, although ${samples}. Choose another iso-value${crop}.`;
}
