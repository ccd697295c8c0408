// The reason why a job's surface is empty, and what to do about it.
import type { Job, Volume } from '../api/types';
import { formatCount, formatValue } from '../ui/format';
import { spanOf } from '../volume/names';
import { isByLabels } from './table';

export function emptyReason({ parameters, mesh }: Job, volume: Pick<Volume, 'range'> | null): string {
  if (isByLabels(parameters)) return 'The surface is empty: the chosen labels have no boundary. Choose other labels.';
  const dropped = mesh?.dropped.components ?? 0;
  if (dropped > 0) {
    const components = dropped === 1 ? 'its only connected component was' : `all ${formatCount(dropped)} connected components were`;
    return `The surface is empty: ${components} dropped. Keep more components.`;
  }
  const iso = mesh?.iso ?? parameters.iso;
  const span = volume ? spanOf(volume) : undefined;
  const at = typeof iso === 'number' ? `at the iso-value ${formatValue(iso, span)}` : 'at this iso-value';
  const where = parameters.crop ? ' within the box' : '';
  if (!volume) return `There is no surface ${at}${where}.`;
  const [low, high] = volume.range;
  const samples = `the volume's samples range from ${formatValue(low, span)} to ${formatValue(high, span)}`;
  if (typeof iso === 'number' && (iso <= low || iso > high)) {
    return `There is no surface ${at}: ${samples}. Choose an iso-value between these limits.`;
  }
  const crop = parameters.crop ? ', or a larger box' : '';
  return `There is no surface ${at}${where}, although ${samples}. Choose another iso-value${crop}.`;
}
