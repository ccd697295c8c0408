// The texts of a job's estimate.
import type { Estimate } from '../../api/types';
import { definitions, h } from '../../ui/dom';
import { formatBytes, formatCount, formatMilliseconds, meshFormatTitle } from '../../ui/format';

function warning(text: string): HTMLElement {
  return h('p.warning', text);
}

export function estimateTexts(estimate: Estimate, isByLabels: boolean): HTMLElement[] {
  const files = Object.entries(estimate.bytes).map(
    ([format, bytes]) => `${meshFormatTitle(format)} ${formatBytes(bytes)}`,
  );
  const stage = estimate.simplified_triangles === undefined ? '' : ' before simplification';
  const rows: [string, string][] = [
    ['Triangles', `${formatCount(estimate.triangles)}${stage}`],
    ['Vertices', `${formatCount(estimate.vertices)}${stage}`],
    ['Files', `about ${files.join(', ')}`],
    ['Time', `about ${formatMilliseconds(estimate.milliseconds)}`],
  ];
  const before = estimate.queue.queued + estimate.queue.running;
  if (before > 0) rows.push(['Jobs ahead', before === 1 ? '1 job' : `${before} jobs`]);
  const texts: HTMLElement[] = [definitions(rows)];
  if (estimate.triangles === 0) {
    texts.push(
      warning(
        isByLabels
          ? 'The chosen labels have no boundary. The surface would be empty.'
          : 'No surface exists at this iso-value. The mesh would be empty.',
      ),
    );
  }
  if (!estimate.fits) {
    texts.push(
      warning(
        `This job needs ${formatBytes(estimate.memory_bytes)} of memory, which is more than a job may use. ` +
          (isByLabels ? 'Choose fewer labels.' : 'Choose an iso-value that gives fewer triangles.'),
      ),
    );
  }
  return texts;
}

// '' if the job is not simplified.
export function simplifiedInWords({ triangles, simplified_triangles: left }: Estimate): string {
  if (left === undefined) return '';
  return `About ${formatCount(left)} of ${formatCount(triangles)} triangles remain.`;
}
