// A list of what to know before a surface is printed, in plain words, and of what helps where it is not ready.
import type { Job, MeshSummary, Vec3 } from '../../api/types';
import { isForPrinter, nozzle } from '../../job/printing';
import { isByLabels } from '../../job/table';
import { makeVariant } from '../../job/variants';
import { fromExtracted, noVolumeText, otherSide, thinnestText } from './certificate';
import { button, h, type Child } from '../../ui/dom';
import { formatBytes, formatCount, formatNumber, formatSize, meshFormatTitle, millimetres } from '../../ui/format';

// A point tells, and neither passes nor fails.
type State = 'good' | 'bad' | 'told';

const marks: Record<State, readonly [string, string]> = { good: ['\u2713', 'Good: '], bad: ['\u2717', 'Not ready: '], told: ['\u2022', ''] };

function point(state: State, ...text: Child[]): HTMLElement {
  const [mark, words] = marks[state];
  return h('li', { 'data-state': state }, [h('span.mark', { 'aria-hidden': 'true' }, mark), h('span', h('span.sr-only', words), ...text)]);
}

// The thickness of walls against the width of the nozzle.
function wallPoint(parameters: Job['parameters'], mesh: MeshSummary, measure: (width: number) => HTMLElement, show: (places: readonly Vec3[]) => void): HTMLElement {
  const width = parameters.min_thickness_mm ?? nozzle;
  if (!mesh.thickness) return point('told', 'Thin walls are not measured. ', measure(width));
  const { place, thinnest_mm: thinnest, thin_area_mm2: area } = mesh.thickness;
  const isThin = thinnest !== null && thinnest < width;
  const nozzles = `the nozzle's ${formatNumber(width, 3)} mm`;
  // Two labels have the area between them together, and each its own walls.
  const share = isByLabels(parameters) ? '' : ` (${formatNumber((100 * area) / mesh.area_mm2)} %)`;
  // Rough surfaces have a wall of nearly nothing somewhere: how much is thin tells more.
  const text = isThin ? `Walls below ${nozzles}: ${formatSize(area)} mm\u00b2 of the surface${share}. The thinnest is ${thinnestText(mesh)}. ` : `Thinnest wall: ${thinnestText(mesh)}, no less than ${nozzles}. `;
  return point(isThin ? 'bad' : 'good', text, place && button('Show it', () => show([place]), { class: 'link', title: 'Marks it on the surface' }));
}

// Null for a surface that was not made for a printer. `show` goes to places on the surface and marks them.
export function printCheck(job: Job, show: (places: readonly Vec3[]) => void): HTMLElement | null {
  const { mesh, parameters } = job;
  if (!mesh || mesh.empty || !isForPrinter(parameters)) return null;
  const make = makeVariant(job);
  const remedy = (text: string, title: string, ...[changes]: Parameters<typeof make>): HTMLElement =>
    button(text, () => make(changes), { class: 'link', title });
  const { closed, encloses_volume: isSolid, oriented, self_intersections: crossings } = mesh.quality;
  const { components } = mesh;

  const points = [
    isSolid
      ? point('good', 'Closed: it has an inside.')
      : closed
      ? point('bad', `Volume ${noVolumeText(mesh.quality)}. `, oriented && otherSide(job, make))
      : point('bad', `Open at ${formatCount(mesh.boundary_edges)} edges. `, !parameters.close && remedy('Close it', 'Starts a job that closes the surface', { close: true })),
  ];
  if (components === 1) points.push(point('good', 'One connected component.'));
  else if (isByLabels(parameters)) points.push(point('told', `${formatCount(components)} connected components, of all labels.`));
  else {
    const keep = remedy('Keep the largest', 'Starts a job that drops all other components', { components: { ...parameters.components, keep: 1 } });
    points.push(point('bad', `${formatCount(components)} connected components, which fall apart. `, keep));
  }
  if (crossings && crossings.pairs > 0) {
    const places = crossings.places;
    const pairs = crossings.pairs === 1 ? '1 pair of triangles crosses. ' : `${formatCount(crossings.pairs)} pairs of triangles cross. `;
    points.push(
      point('bad', pairs, 'Programs for printers often repair this. ', places.length > 0 && button('Show them', () => show(places), { class: 'link', title: 'Marks them on the surface' }), ' ',
        parameters.passes > 0 && !parameters.untangle && remedy('Untangle them', 'Starts a job that moves triangles back where smoothing made them cross', { untangle: true })),
    );
  } else if (crossings) points.push(point('good', 'No triangle crosses another one.'));
  const distance = fromExtracted(mesh);
  if (distance) {
    points.push(
      distance.proven
        ? point('good', `Nowhere more than ${millimetres(distance.mm)} mm from the scan. This is proven.`)
        : point('told', `Up to ${millimetres(distance.mm)} mm from the scan, as measured at points. This is not proven.`),
    );
  }
  const measure = (width: number): HTMLElement => remedy('Measure them', 'Starts a job that finds walls below the width of your nozzle', { min_thickness_mm: width });
  points.push(wallPoint(parameters, mesh, measure, show));
  const [low, high] = mesh.bounds;
  const size = low.map((value, axis) => formatSize((high[axis as 0] ?? 0) - value)).join(' \u00d7 ');
  const material = mesh.quality.encloses_volume ? `, ${formatNumber(mesh.volume_mm3.smoothed / 1000, 2)} cm\u00b3 if it is filled` : '';
  points.push(point('told', `${size} mm${material}.`));
  const files = ['stl', '3mf'].flatMap((format) => {
    const file = mesh.files[format as 'stl'];
    return file ? [`${meshFormatTitle(format)} ${formatBytes(file.bytes)}`] : [];
  });
  points.push(point('told', `${files.join(', ')}; ${formatCount(mesh.triangles)} triangles.`));
  return h('ul.print-check', ...points);
}
