import { describe, expect, it } from 'vitest';
import type { JobParameters, LabelSummary, Label } from '@/api/types';
import { labelOrders, labelsCsv, LabelState, labelTitle, matching } from '@/job/labels';
import {
  changed,
  defaultParameters,
  estimateQuery,
  filesOf,
  inWords,
  isSameJob,
  jobRequest,
  parametersOfQuery,
  queryOfParameters,
  surfaceInWords,
  variantOf,
} from '@/job/parameters';
import { titlesOf } from '@/job/differences';
import { commandSnippet, curlSnippet } from '@/job/snippets';
import { parameterOf, withLabels } from '@/job/table';

const volume = 'v'.repeat(64);
const defaults = defaultParameters(volume, 60);
const all = withLabels(defaults, 'all');
const some = withLabels(defaults, [3, -1]);

describe('a job by labels', () => {
  it('says its labels and nothing that is for an iso-value', () => {
    expect(jobRequest(all)).toEqual({ volume, labels: 'all', formats: ['glb'] });
    expect(jobRequest(some)).toEqual({ volume, labels: [3, -1], formats: ['glb'] });
    const other: JobParameters = { ...all, interpolation: 'midpoint', components: { keep: 1, min_triangles: null } };
    expect(jobRequest(other)).toEqual(jobRequest(all));
    const untold = Object.entries(all).filter(([name]) => !['label_names', 'background'].includes(name));
    expect(jobRequest(Object.fromEntries(untold) as JobParameters)).toEqual(jobRequest(all));
    expect(estimateQuery(some).toString()).toBe(`volume=${volume}&labels=3%2C-1&format=glb`);
  });

  it('has passes of its own by default, and keeps those that were chosen', () => {
    expect([defaults.passes, all.passes, withLabels(all, undefined).passes]).toEqual([5, 10, 5]);
    expect(jobRequest({ ...all, passes: 5 })).toMatchObject({ passes: 5 });
    const chosen = { ...defaults, passes: 3 };
    expect(withLabels(chosen, 'all').passes).toBe(3);
    expect(jobRequest(withLabels(all, undefined))).toEqual(jobRequest(defaults));
    expect(isSameJob(variantOf(all, { passes: 10 }), all)).toBe(true);
    expect(changed(all, parameterOf('smoothing'), 'taubin').passes).toBe(10);
  });

  it('comes back from an address as it was', () => {
    const named: JobParameters = {
      ...some,
      passes: 4,
      background: 9,
      label_names: { 3: 'Liver, left' },
      label_colors: { '-1': '#d8654f' },
      label_values: { 3: [3, 4] },
    };
    for (const job of [all, some, named]) {
      const query = new URLSearchParams(queryOfParameters(job, defaults));
      expect(query.get('iso')).toBe('');
      expect(parametersOfQuery(query, defaults)).toEqual(job);
    }
    const wrong = new URLSearchParams('labels=1,x&background=a&label_names=[&label_values={"a":[1]}');
    expect(parametersOfQuery(wrong, defaults)).toEqual(defaults);
  });

  it('is told again by command and by curl', () => {
    const named: JobParameters = { ...some, label_names: { 3: "Liver's lobe" }, label_values: { 3: [3, 4] }, formats: ['glb', 'stl'] };
    const text = commandSnippet('http://h:1', named, false);
    expect(text).toContain('--labels 3,-1 ');
    expect(text).toContain(`--label-name '3=Liver'\\''s lobe' --label-values 3=3,4`);
    expect(text).not.toContain('--iso');
    expect(text).toContain('-o mesh.glb -o mesh.zip');
    expect(curlSnippet('http://h:1', named, false)).toContain('JOB/mesh.zip');
    expect(curlSnippet('http://h:1', { ...named, formats: ['obj'] }, false)).toContain('-o mesh.mtl http://h:1/v1/jobs/JOB/mesh.mtl');
    const surface = curlSnippet('http://h:1', { ...defaultParameters('v', 1), formats: ['obj', 'gii'] }, false);
    expect(surface).toContain('-o mesh.surf.gii http://h:1/v1/jobs/JOB/mesh.gii');
    expect(surface).not.toContain('mesh.mtl');
    expect(commandSnippet('http://h:1', { ...all, regularize: false }, false)).toContain('--no-regularize');
  });

  it('has one file for all labels, or a ZIP', () => {
    expect(filesOf({ ...all, formats: ['glb', 'stl', 'obj', 'drc'] })).toEqual(['glb', 'obj', 'zip']);
    expect(filesOf({ ...defaults, formats: ['glb', 'stl'] })).toEqual(['glb', 'stl']);
  });

  it('is told from others in words', () => {
    expect([defaults, { ...defaults, inside: 'below' as const }, all, some, withLabels(defaults, [7])].map(surfaceInWords)).toEqual([
      'iso 60',
      'below iso 60',
      'all labels',
      '2 labels',
      'label 7',
    ]);
    expect(inWords(all)).toBe('6 tetrahedra, without steps');
    expect(inWords({ ...all, smoothing: 'taubin' })).toBe('6 tetrahedra, 10 passes (taubin)');
    const jobs = [defaults, all].map((parameters) => ({ parameters }) as Parameters<typeof titlesOf>[0][0]);
    expect(titlesOf(jobs)).toEqual(['iso 60, 5 passes, laplacian', 'all labels, 10 passes, labels']);
  });
});

const summaries = [
  { label: 1, name: 'Left kidney', color: '#112233' },
  { label: 2, name: 'Right kidney', color: null },
  { label: 12 },
] as LabelSummary[];

describe('labels in a list', () => {
  it('are found by all words of their name, or by their value', () => {
    const found = (text: string): Label[] => matching(summaries, text).map(({ label }) => label);
    expect(found('')).toEqual([1, 2, 12]);
    expect(found('KIDNEY right')).toEqual([2]);
    expect(found('label')).toEqual([12]);
    expect(found('1')).toEqual([1, 12]);
    expect(found('spleen')).toEqual([]);
    expect(summaries.map(labelTitle)).toEqual(['Left kidney', 'Right kidney', 'label 12']);
  });
});

describe('which labels are seen', () => {
  const hidden = (state: LabelState): Label[] => [...state.hidden.value].sort((a, b) => Number(a) - Number(b));

  it('is changed one by one, all at once, and by isolating one', () => {
    const state = new LabelState(summaries);
    state.show(2, false);
    expect([hidden(state), state.isShown(2), state.isShown(1)]).toEqual([[2], false, true]);
    state.isolate(2);
    expect([hidden(state), state.isAlone(2), state.isAlone(1)]).toEqual([[1, 12], true, false]);
    state.isolate(1);
    expect(hidden(state)).toEqual([2, 12]);
    state.isolate(1);
    expect(hidden(state)).toEqual([]);
    state.hideAll();
    expect(hidden(state)).toEqual([1, 2, 12]);
    state.show(12, true);
    expect(state.isAlone(12)).toBe(true);
    state.showAll();
    expect(hidden(state)).toEqual([]);
  });

  it('leaves a label shown that is the only one', () => {
    const state = new LabelState(summaries.slice(0, 1));
    state.isolate(1);
    expect(hidden(state)).toEqual([]);
  });

  it('tells whoever listens, also of colours and of what is picked', () => {
    const state = new LabelState(summaries);
    const told: string[] = [];
    state.hidden.subscribe((labels) => told.push(`hidden ${labels.size}`));
    state.colours.subscribe((colours) => told.push([...colours.values()].join(' ')));
    state.picked.subscribe((label) => told.push(label ? labelTitle(label) : 'nothing'));
    state.show(1, false);
    state.learnColour(1, '#ffffff'); // the file's own stays
    state.learnColour(2, '#445566');
    state.setColour(1, '#abcdef');
    state.pick(12);
    state.pick(99);
    expect(told).toEqual(['hidden 1', '#112233 #445566', '#abcdef #445566', 'label 12', 'nothing']);
  });
});

describe('the table of labels', () => {
  const label = (number: number, name: string, more: Partial<LabelSummary> = {}): LabelSummary =>
    ({ label: number, name, color: null, voxels: 10, voxels_mm3: 10 * number, closed: true, oriented: true, components: 1, area_mm2: 9, volume_mm3: 8, triangles: 4, ...more }) as LabelSummary;
  const labels = [label(1, 'Rib 10'), label(2, 'Rib 2', { components: 3 }), label(3, '=A1, "x" y', { closed: false, area_mm2: 99 })];

  it('is put into the order that a person chooses', () => {
    const order = (name: keyof typeof labelOrders): unknown[] => [...labels].sort(labelOrders[name][1]).map((one) => one.label);
    expect(order('value')).toEqual([1, 2, 3]);
    expect(order('name')).toEqual([3, 2, 1]);
    expect(order('volume')).toEqual([3, 2, 1]);
    expect(order('area')).toEqual([3, 1, 2]);
    expect(order('components')).toEqual([2, 1, 3]);
  });

  it('is read by a spreadsheet, which runs nothing of it', () => {
    expect(labelsCsv(labels, new Map([[1, '#010203']])).split('\r\n')).toEqual([
      'label,name,color,voxels,voxels_mm3,mesh_mm3,area_mm2,components,triangles',
      '1,Rib 10,#010203,10,10,8,9,1,4',
      '2,Rib 2,,10,20,8,9,3,4',
      `3,"'=A1, ""x"" y",,10,30,,99,1,4`,
      '',
    ]);
  });

  it('has no volume for a label whose surface is inside out', () => {
    expect(labelsCsv([label(1, 'Rib 10', { volume_mm3: -8 })], new Map()).split('\r\n')[1]).toBe('1,Rib 10,,10,10,,9,1,4');
  });
});
