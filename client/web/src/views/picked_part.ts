// The part of a surface that was clicked, where it has several: the others can be left out of a new job.
import type { Job, JobParameters, Vec3 } from '../api/types';
import { button, h } from '../ui/dom';
import { formatCount } from '../ui/format';
import { isByLabels } from '../job/table';

// The parameters that keep that part alone. Parts that were left out before stay out: what is nearest to
// the place is of those that are there.
export function keepOnlyAt(point: Vec3): Partial<JobParameters> {
  const place = point.map((value) => Number(value.toFixed(3))) as Vec3;
  return { components: { keep: null, min_triangles: null, nearest_to: [place] } };
}

export class PickedPart {
  readonly element = h('div', { class: 'picked-part', role: 'status', hidden: true });
  private readonly parts: number;

  constructor(
    job: Job,
    private readonly keep: (variant: Partial<JobParameters>) => void,
  ) {
    this.parts = isByLabels(job.parameters) ? 1 : (job.mesh?.components ?? 1);
  }

  // Null for nowhere.
  show(point: Vec3 | null): void {
    const isPart = point !== null && this.parts > 1;
    this.element.hidden = !isPart;
    if (!isPart) return;
    this.element.replaceChildren(
      h('span', {}, `One of ${formatCount(this.parts)} parts, at ${point.map((value) => value.toFixed(1)).join(', ')} mm`),
      button('Keep only this part', () => this.keep(keepOnlyAt(point)), {
        class: 'link',
        title: 'Starts a job that leaves all others out',
      }),
    );
  }
}
