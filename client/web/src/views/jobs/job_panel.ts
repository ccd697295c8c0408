// The panel beside a surface: its numbers, timings, files, and links to make others.
import { token } from '../../client';
import type { Job, JobParameters, MeshSummary, Volume } from '../../api/types';
import { changeOf, type Change } from '../../job/changes';
import { labelTitle } from '../../job/labels';
import { surfaceInWords } from '../../job/parameters';
import { commandSnippet, curlSnippet, javascriptSnippet, librarySnippet, pythonSnippet } from '../../job/snippets';
import { fits, isByLabels, isOfKind, meshFormats, parameterOf, valueIn, valuesOf } from '../../job/table';
import { fileNameOf, makeVariant, saveVariant, submitVariant } from '../../job/variants';
import { button, definitions, h, type Child } from '../../ui/dom';
import { formatBytes, formatCount, formatIso, formatNumber, formatSize, formatValue, meshFileSuffix, meshFormatTitle } from '../../ui/format';
import { tell, tellError } from '../../ui/notices';
import { go, hashOf } from '../../ui/route';
import { saveFile } from '../../ui/save';
import { exportActions } from './export_section';
import { certificateBody, intersectionsText, openText, thinnestText, untangledText } from './certificate';
import { distributionChart, stepsOf, totalOf, waterfall, type Durations } from './charts';

export function section(title: string, ...children: Child[]): HTMLElement {
  return h('section.panel-section', h('h2', title), ...children);
}

const mostNamed = 3;

export function titleOf({ parameters, mesh }: Pick<Job, 'parameters' | 'mesh'>): string {
  const { labels, iso } = parameters;
  if (labels === undefined) return `Surface at ${formatIso(iso ?? 'otsu')}`;
  const made = mesh?.labels ?? [];
  const areNamed = made.length > 0 && made.length <= mostNamed && made.some(({ name }) => name !== null);
  return `Surfaces of ${areNamed ? made.map(labelTitle).join(', ') : surfaceInWords(parameters)}`;
}

function change(before: number, after: number): string {
  if (before === 0) return '';
  const percent = (100 * (after - before)) / Math.abs(before);
  const sign = percent > 0 ? '+' : '';
  return ` (${sign}${formatNumber(percent, Math.abs(percent) < 1 ? 2 : 1)}\u00a0%)`;
}

function sized(value: number, unit: string): string {
  return `${formatValue(value)} ${unit}`;
}

function trianglesText({ triangles, simplified }: MeshSummary): Child {
  if (!simplified) return formatCount(triangles);
  const bound = {
    error: 'stopped at the allowed error',
    triangles: 'stopped at the requested number',
    topology: 'fewer would open or fold the surface, or change its boundary',
  }[simplified.bound_by];
  return h('span', { title: `Simplification ${bound}` }, [
    formatCount(triangles),
    h('span.faint', ` simplified from ${formatCount(simplified.triangles_before)}; ${bound}`),
  ]);
}

function changedText(before: number, after: number, unit: string, stage: Change | null): Child {
  const since = stage && h('span.faint', `${change(before, after)}, ${sized(before, unit)} ${stage.before}`);
  return h('span', sized(after, unit), since);
}

// People often want only the largest connected component.
function componentsText(job: Job, { components }: MeshSummary): Child {
  if (components < 2 || isByLabels(job.parameters)) return formatCount(components);
  const keep = (): void => makeVariant(job)({ components: { keep: 1, min_triangles: null } });
  return h('span', `${formatCount(components)} `, button('Keep the largest', keep, { class: 'link', title: 'Starts a job that drops all other connected components' }));
}

export function numbers(job: Job, mesh: MeshSummary): HTMLElement {
  const [low, high] = mesh.bounds;
  const extent = low.map((value, axis) => formatSize((high[axis as 0] ?? 0) - value)).join(' \u00d7 ');
  const { mean, max } = mesh.displacement_mm;
  const stage = changeOf(job.parameters, mesh);
  const rows: [string, Child][] = [
    ['Iso-value', mesh.iso === undefined ? '' : `${formatValue(mesh.iso)}${job.parameters.iso === 'otsu' ? ', by Otsu' : ''}`],
    ['Triangles', trianglesText(mesh)],
    ['Vertices', formatCount(mesh.vertices)],
    [
      'Volume',
      mesh.quality.encloses_volume
        ? changedText(mesh.volume_mm3.extracted, mesh.volume_mm3.smoothed, 'mm\u00b3', stage)
        : openText(job, makeVariant(job)),
    ],
    ['Area', changedText(mesh.area_extracted_mm2, mesh.area_mm2, 'mm\u00b2', stage)],
    [
      'Closed',
      mesh.quality.closed
        ? 'yes'
        : h('span.attention', `no, ${formatCount(mesh.boundary_edges)} boundary edges`),
    ],
    ['Connected components', componentsText(job, mesh)],
    ['Genus', mesh.quality.genus === null ? '' : formatCount(mesh.quality.genus)],
    ['Extent', `${extent} mm`],
    ['Untangled', untangledText(mesh)],
    ['Self-intersections', intersectionsText(mesh)],
    ['Thinnest wall', thinnestText(mesh)],
    ['Notes', mesh.notes?.map(({ detail }) => detail).join(' ') ?? ''],
    ['Moved by smoothing', job.parameters.passes > 0 ? `mean ${formatNumber(mean, 3)}, largest ${formatNumber(max, 3)} mm` : ''],
  ];
  if (mesh.dropped.components > 0) {
    rows.push([
      'Dropped components',
      `${formatCount(mesh.dropped.components)}, with ${formatCount(mesh.dropped.triangles)} triangles`,
    ]);
  }
  return definitions(rows.filter(([, value]) => value !== ''));
}

export function quality({ parameters }: Job, mesh: MeshSummary): HTMLElement {
  const stage = changeOf(parameters, mesh);
  const { aspect_ratio: aspect, smallest_angle_deg: angle } = mesh.quality;
  return section(
    'Triangle quality',
    h('div.distributions', [
      distributionChart('Radius ratio', aspect, 1, '', stage),
      distributionChart('Smallest angle', angle, 60, '\u00b0', stage),
    ]),
    stage && h('p.hint', `Filled: ${stage.after}. Line: ${stage.before}.`),
  );
}

// Null where the job's error was not measured.
export function accuracy(job: Job, onColour: () => void): HTMLElement | null {
  const body = certificateBody(job);
  if (!body) return null;
  body.append(button('Show the distance as colour', onColour));
  return section('Distance from the scan', body);
}

export function timings(job: Job, more: Durations = {}): HTMLElement {
  return section('Time', waterfall(stepsOf(job.timing, more), totalOf(job.timing, more)));
}

export function downloads(job: Job, volume: Volume | null, onReport: () => void): HTMLElement {
  const files = job.mesh?.files ?? {};
  const name = (format: string): string => fileNameOf(job, volume, `.${meshFileSuffix(format)}`);
  const missing = meshFormats.filter((format) => !job.parameters.formats.includes(format));
  return section(
    'Download',
    h('div.downloads', [
      ...[...meshFormats, 'zip'].flatMap((format) => {
        const file = files[format];
        return file
          ? [
              button(
                h('span', h('b', meshFormatTitle(format)), ` ${formatBytes(file.bytes)}`),
                () => void saveFile(file.href, name(format), file.bytes).catch(tellError),
                { 'data-format': format },
              ),
            ]
          : [];
      }),
      files['obj'] && isByLabels(job.parameters) &&
        button(
          'Colours of the OBJ',
          () => void saveFile(`/v1/jobs/${job.id}/mesh.mtl`, 'mesh.mtl', 0).catch(tellError),
          { 'data-format': 'mtl', title: 'Save it as mesh.mtl beside the OBJ, which names it so. Each OBJ needs a folder of its own for the two' },
        ),
    ]),
    missing.length > 0 &&
      h('div.make', [
        h('span.faint', 'Make and save:'),
        ...missing.map((format) =>
          button(meshFormatTitle(format), () => void saveVariant(job, volume, format), { class: 'chip' }),
        ),
      ]),
    h('div.actions', button('Report', onReport, { title: 'One sheet to print or to keep: pictures, numbers, proof, versions, hashes' })),
    exportActions(job, volume),
  );
}

export interface Comparison {
  title: string;
  variants: Partial<JobParameters>[];
}

// Sets that show what a parameter does.
export const comparisons: readonly Comparison[] = [
  {
    title: '5 and 6 tetrahedra, linear and midpoint',
    variants: [
      { scheme: 5, interpolation: 'linear' },
      { scheme: 6, interpolation: 'linear' },
      { scheme: 5, interpolation: 'midpoint' },
      { scheme: 6, interpolation: 'midpoint' },
    ],
  },
  { title: 'the lattices', variants: [{ scheme: 6 }, { scheme: 5 }, { scheme: 'bcc' }] },
  { title: '0, 5 and 10 passes', variants: [{ passes: 0 }, { passes: 5 }, { passes: 10 }] },
  {
    title: 'all methods of smoothing',
    variants: valuesOf<JobParameters['smoothing']>('smoothing').map((smoothing) => ({ smoothing })),
  },
];

export function compareSection(job: Job): HTMLElement {
  const takes = (variant: Partial<JobParameters>): boolean =>
    Object.keys(variant).every((name) => {
      const parameter = parameterOf(name);
      return isOfKind(parameter, job.parameters) && fits(parameter, valueIn(variant, parameter) ?? null, job.parameters);
    });
  const start = async (variants: Partial<JobParameters>[]): Promise<void> => {
    try {
      const jobs = await Promise.all(variants.map((variant) => submitVariant(job, variant)));
      go(['compare'], new URLSearchParams({ jobs: jobs.map(({ id }) => id).join(',') }));
    } catch (error) {
      tellError(error);
    }
  };
  return section(
    'Compare',
    h('div.stack', [
      ...comparisons
        .map(({ title, variants }) => ({ title, variants: variants.filter(takes) }))
        .filter(({ variants }) => variants.length > 1)
        .map(({ title, variants }) => button(title, () => void start(variants))),
    ]),
    h('p.hint', 'Starts the jobs that are missing. The list of jobs can compare any other jobs.'),
  );
}

function copyButton(text: () => string): HTMLButtonElement {
  const copy = async (): Promise<void> => {
    try {
      await navigator.clipboard.writeText(text());
      element.textContent = 'Copied';
      setTimeout(() => (element.textContent = 'Copy'), 1500);
    } catch {
      // Without TLS there is no clipboard.
      tell('The browser does not allow copying here. Select the text instead.');
    }
  };
  const element = button('Copy', () => void copy());
  return element;
}

export function againSection(job: Job): HTMLElement {
  const hasToken = token.value !== '';
  const origin = window.location.origin;
  const snippets = [
    ['the isomesh command', commandSnippet],
    ['curl', curlSnippet],
    ['Python', pythonSnippet],
    ['JavaScript', javascriptSnippet],
    ['the C++ library', librarySnippet],
  ] as const;
  // With all that the address says of how it is looked at.
  const link = (): string => window.location.href;
  const shown = h('input', { readonly: true, value: `${origin}/${hashOf(['jobs', job.id])}`, 'aria-label': 'Link to this surface' });
  shown.addEventListener('focus', () => (shown.value = link()));
  const block = (name: string, text: string): HTMLElement =>
    h('details.snippet', [
      h('summary', name),
      h('pre', { tabindex: '0' }, text),
      copyButton(() => text),
    ]);
  return section(
    'Repeat this job',
    h('div.link-row', shown, copyButton(link)),
    ...snippets.map(([name, snippet]) => block(`With ${name}`, snippet(origin, job.parameters, hasToken))),
  );
}
