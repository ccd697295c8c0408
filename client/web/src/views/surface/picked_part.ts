// The connected component that was clicked, if a surface has several: its size, and a new job with or without it.
import type { Job, JobParameters, Vec3 } from '../../api/types';
import type { PartFinder, PartSummary } from '../../mesh/part_finder';
import type { Picked } from '../../scene/picked';
import { isByLabels } from '../../job/table';
import type { MakeVariant } from '../../job/variants';
import { button, h } from '../../ui/dom';
import { formatCount, formatSize, formatValue } from '../../ui/format';
import type { Scope } from '../../ui/signal';

const slice = 8; // milliseconds for one step of the search for components
// A job lists each component that it keeps.
const mostPlaces = 1000;

function placeOf(point: Vec3): Vec3 {
  return point.map((value) => Number(value.toPrecision(7))) as Vec3;
}

// The parameters that keep only the components at those points. Components that were dropped before stay dropped,
// because the nearest component to a point is one of those that are left.
export function keepOnlyAt(...points: Vec3[]): Partial<JobParameters> {
  return { components: { keep: null, min_triangles: null, nearest_to: points.map(placeOf) } };
}

export class PickedPart {
  readonly element = h('div.picked-part', { role: 'status', hidden: true });
  private readonly parts: number;
  private asked = 0;

  constructor(
    private readonly scope: Scope,
    private readonly job: Job,
    private readonly make: MakeVariant,
  ) {
    this.parts = isByLabels(job.parameters) ? 1 : (job.mesh?.components ?? 1);
  }

  // Null for nowhere.
  show(picked: Picked | null, finder: () => PartFinder): void {
    this.asked += 1;
    const isPart = picked?.triangle != null && this.parts > 1;
    this.element.hidden = !isPart;
    if (!isPart) return;
    this.fill(picked.point, null, []);
    const { asked } = this;
    const parts = finder();
    const look = (): void => {
      if (this.scope.isOver || asked !== this.asked) return;
      const until = performance.now() + slice;
      while (performance.now() < until) {
        if (parts.step()) continue;
        this.fill(picked.point, parts.partOf(...(picked.triangle as [number, number])), parts.all);
        return;
      }
      setTimeout(look);
    };
    look();
  }

  private fill(point: Vec3, part: PartSummary | null, all: readonly PartSummary[]): void {
    const others = all.filter(({ number }) => number !== part?.number);
    const isClosed = this.job.mesh?.quality.encloses_volume ?? false;
    const size = part
      ? [isClosed && `volume ${formatValue(part.volume)} mm\u00b3`, `area ${formatValue(part.area)} mm\u00b2`, `${formatCount(part.triangles)} triangles`]
      : [`at ${point.map((value) => formatSize(value)).join(', ')} mm`];
    this.element.replaceChildren(
      h('span', `One of ${formatCount(this.parts)} connected components: ${size.filter(Boolean).join(', ')}`),
      button('Keep only this component', () => this.make(keepOnlyAt(point)), {
        class: 'link',
        title: 'Starts a job that drops all other components',
      }),
      button('Drop this component', () => this.make(keepOnlyAt(...others.map((other) => other.point))), {
        class: 'link',
        disabled: others.length === 0 || others.length > mostPlaces,
        title: others.length > mostPlaces ? 'There are too many other components' : 'Starts a job that keeps all other components',
      }),
    );
  }
}
