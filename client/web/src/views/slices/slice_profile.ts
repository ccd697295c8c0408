// The values along the last length that was drawn in a slice, from its first point to its second.
import type { Volume } from '../../api/types';
import { h, svg } from '../../ui/dom';
import { formatValue } from '../../ui/format';
import type { Scope } from '../../ui/signal';
import { slicePlane } from '../../volume/geometry';
import { profileOf, type ExactSamples } from '../../volume/exact';
import type { SliceMeasures } from './slice_measure';

const [width, height] = [320, 72];

export function sliceProfile(volume: Volume, measures: SliceMeasures, exact: ExactSamples, scope: Scope): HTMLElement {
  const element = h('figure.slice-profile', { hidden: true });
  const show = async (): Promise<void> => {
    const last = measures.lastLength;
    element.hidden = last === undefined;
    if (!last) return;
    const plane = slicePlane(volume, last.plane);
    const slice = await exact.get(plane.normal, last.index);
    if (measures.lastLength !== last) return;
    const values = profileOf(slice, last.points as [[number, number], [number, number]]);
    const [least, greatest] = [Math.min(...values), Math.max(...values)];
    const at = (value: number, place: number): string =>
      `${(width * place) / (values.length - 1)},${height - (height * (value - least)) / (greatest - least || 1)}`;
    const said = `Profile along the last length: least ${formatValue(least)}, greatest ${formatValue(greatest)}`;
    element.replaceChildren(
      svg('svg', { viewBox: `0 -2 ${width} ${height + 4}`, preserveAspectRatio: 'none', role: 'img', 'aria-label': said }, svg('polyline', { points: values.map(at).join(' ') })),
      h('figcaption.hint', `${said}.`),
    );
  };
  const update = (): void => void show().catch(() => (element.hidden = true)); // The slices say what fails.
  scope.onEnd(measures.changes.subscribe(update));
  update();
  return element;
}
