// The measured error of a mesh and the faults of its surface: the certificate, self-intersections,
// openings.
import type { DistanceSummary, Job, MeshSummary } from '../../api/types';
import { isByLabels } from '../../job/table';
import type { MakeVariant } from '../../job/variants';
import { button, h, svg, type Child } from '../../ui/dom';
import { formatCount, formatSize, formatValue, meshFormatTitle, millimetres } from '../../ui/format';
import { stepsPath } from './charts';

type Certificate = NonNullable<MeshSummary['certificate']>;

const width = 320;
const height = 64;

// Both ways over one axis, from 0 to the larger maximum. Counts differ by powers of ten: heights are
// their logarithms, and a bin with a single point is still seen.
export function histogramPath({ histogram, max_mm: max }: DistanceSummary, most: number, top: number): string {
  if (max === 0) return '';
  const shares = histogram.map((count) => (count === 0 ? 0 : (1 + Math.log10(count)) / (1 + Math.log10(top))));
  return stepsPath(shares, (width * max) / most, height);
}

function chart({ from_mesh: mesh, from_extracted: extracted, found_mm: most }: Certificate): HTMLElement | null {
  if (most === 0) return null;
  const top = Math.max(1, ...mesh.histogram, ...extracted.histogram);
  return h('figure.distribution.distances', [
    svg('svg', {
      viewBox: `0 0 ${width} ${height}`,
      preserveAspectRatio: 'none',
      role: 'img',
      'aria-label': `Distribution of the distances from 0 to ${millimetres(most)} millimetres, in both directions`,
    }, [
      svg('path.after', { d: histogramPath(mesh, most, top) }),
      svg('path.before', { d: histogramPath(extracted, most, top) }),
    ]),
    h('div.distribution-axis', { 'aria-hidden': 'true' }, [
      h('span', '0'),
      h('span', `${millimetres(most)} mm`),
    ]),
    h('figcaption', 'Filled: from the file. Line: to the file. The height shows the logarithm of the number of points.'),
  ]);
}

// The surface that distances count from.
export function referenceText({ reference }: Pick<Certificate, 'reference'>): string {
  return `${reference} surface`;
}

// The distance of the mesh from the extracted surface: proven, or as it was found. The displacement by smoothing adds to a distance from the smoothed surface.
export function fromExtracted(mesh: Pick<MeshSummary, 'certificate' | 'displacement_mm'>): { mm: number; proven: boolean } | null {
  const { certificate, displacement_mm: moved } = mesh;
  if (!certificate) return null;
  const { bound_mm: bound, found_mm: found, reference } = certificate;
  return { mm: (bound ?? found) + (reference === 'smoothed' ? moved.max : 0), proven: typeof bound === 'number' };
}

function bothWays({ from_mesh: mesh, from_extracted: extracted, reference }: Certificate): HTMLElement {
  const row = (name: string, title: string, distances: DistanceSummary): HTMLElement =>
    h('tr', { title }, [
      h('th', { scope: 'row' }, name),
      ...[distances.max_mm, distances.p99_mm, distances.mean_mm].map((value) =>
        h('td.number', millimetres(value)),
      ),
    ]);
  return h('table.both-ways', [
    h('caption.sr-only', 'Distances in millimetres'),
    h('tr', [
      h('th', { scope: 'col' }, 'mm'),
      ...['largest', '99th percentile', 'mean'].map((name) => h('th.number', { scope: 'col' }, name)),
    ]),
    row('from the file', `From the file to the ${referenceText({ reference })}; shows what was added`, mesh),
    row('to the file', `From the ${referenceText({ reference })} to the file; shows what was left out`, extracted),
  ]);
}

function spent({ budget_mm: budget }: Certificate, allowed: number | null | undefined): HTMLElement | null {
  if (!budget || typeof allowed !== 'number') return null;
  const parts = [
    ['smoothing', budget.smoothing],
    ['fewer triangles', budget.simplification],
    ['rounding', budget.quantisation],
  ] as const;
  const bar = h('div.budget', { 'aria-hidden': 'true' });
  for (const [name, value] of parts) {
    const part = h('span', { class: `of-${name.split(' ').at(-1)}`, title: `${name} ${millimetres(value)} mm` });
    part.style.flexGrow = String(Math.max(0, value / allowed));
    bar.append(part);
  }
  const words = parts.map(([name, value]) => `${name} ${millimetres(value)}`).join(', ');
  return h('div.spent', bar, h('p.hint', `The allowed ${formatValue(allowed)} mm are divided into: ${words} mm.`));
}

// Null if nothing was measured or the surface is empty.
export function certificateBody(job: Job): HTMLElement | null {
  const certificate = job.mesh?.certificate;
  if (!certificate || job.mesh?.empty) return null;
  const allowed = job.parameters.max_error_mm;
  const isOne = Object.keys(job.mesh?.files ?? {}).length === 1;
  const file = meshFormatTitle(certificate.file);
  return h('div.certificate', [
    h('p', [
      h('b', `${millimetres(certificate.found_mm)} mm`),
      ` is the largest distance that was found between the ${file} file and the ${referenceText(certificate)}.`,
      isOne ? '' : ' Every other file is at least as near.',
      typeof allowed === 'number' ? ` Allowed: ${formatValue(allowed)} mm.` : '',
    ]),
    typeof certificate.bound_mm === 'number'
      ? h('p', `Proven: no point of any file or of the ${referenceText(certificate)} is more than `, h('b', `${millimetres(certificate.bound_mm)} mm`), ' from the other.')
      : h('p.hint', `Measured at points, not proven for all. ${certificate.why_unproven ?? ''}`),
    certificate.reference === 'smoothed' &&
      h('p.hint', `Smoothing moved vertices by at most ${millimetres(job.mesh?.displacement_mm.max ?? 0)} mm from the extracted surface before.`),
    bothWays(certificate),
    chart(certificate),
    spent(certificate, allowed),
  ]);
}

function pairsText(pairs: number): string {
  return pairs === 1 ? '1 pair of triangles' : `${formatCount(pairs)} pairs of triangles`;
}

// '' unless the job removed intersections.
export function untangledText({ untangled }: Pick<MeshSummary, 'untangled'>): string {
  if (!untangled) return '';
  if (untangled.pairs === 0) return 'nothing intersected';
  const left = untangled.left === 0 ? '' : `; ${pairsText(untangled.left)} intersect as extracted`;
  return `${pairsText(untangled.pairs)}, ${formatCount(untangled.vertices)} vertices moved back${left}`;
}

export function intersectionsText({ quality }: MeshSummary): Child {
  const found = quality.self_intersections;
  if (!found) return '';
  if (found.pairs === 0) return 'none';
  const [first] = found.places;
  const at = first ? ` The first pair is at ${first.map(formatSize).join(', ')} mm.` : '';
  return h('span.attention', { title: `These triangles intersect.${at}` }, pairsText(found.pairs));
}

// '' unless the job measured walls.
export function thinnestText({ thickness }: Pick<MeshSummary, 'thickness'>): string {
  if (!thickness) return '';
  const { place, thinnest_mm: thinnest } = thickness;
  return place && thinnest !== null ? `${millimetres(thinnest)} mm at ${place.map(formatSize).join(', ')}` : 'none';
}

// The reason why a surface encloses no volume.
export function noVolumeText({ closed, oriented }: { closed: boolean; oriented: boolean }): string {
  if (!closed) return 'none: the surface is open';
  return oriented ? 'none: the surface is inside out' : 'none: the triangles disagree about which side is outside';
}

// Starts a job with the other side of the iso-value inside.
export function otherSide({ parameters }: Job, make: MakeVariant): Child {
  if (isByLabels(parameters)) return false;
  const [inside, text] = parameters.inside === 'below' ? (['above', 'Take the bright side'] as const) : (['below', 'Take the dark side'] as const);
  const title = `Starts a job with the samples ${inside} the iso-value inside`;
  return button(text, () => make({ inside }), { class: 'link', title });
}

// For a surface whose volume would be a number without a meaning.
export function openText(job: Job, make: MakeVariant): Child {
  const { parameters, mesh } = job;
  const { closed, oriented } = mesh?.quality ?? { closed: false, oriented: false };
  const text = noVolumeText({ closed, oriented });
  if (closed && !oriented) return h('span.attention', text);
  if (closed) return h('span.attention', [`${text}. `, otherSide(job, make)]);
  return h('span.attention', [
    `${text}. `,
    !parameters.close && button('Close it', () => make({ close: true }), { class: 'link', title: 'Starts a job that closes the surface at the border of the volume' }),
  ]);
}
