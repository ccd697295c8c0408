import { execFileSync } from 'node:child_process';
import { describe, expect, it } from 'vitest';
import type { Job, JobParameters } from '@/api/types';
import { parseRoute, hashOf } from '@/ui/route';
import { formatBytes, formatCount, formatMilliseconds, formatValue } from '@/ui/format';
import { titlesOf } from '@/job/differences';
import {
  changed,
  defaultParameters,
  isSameJob,
  jobRequest,
  parametersOfQuery,
  queryOfParameters,
  variantOf,
} from '@/job/parameters';
import { commandSnippet, curlSnippet, javascriptSnippet, librarySnippet, pythonSnippet } from '@/job/snippets';
import { parameterOf } from '@/job/table';
import { rawFault } from '@/volume/raw';
import { draggedWindow } from '@/volume/slices';
import { inSlice, textOfWindow, windowOfText, windowToFetch } from '@/volume/slices';
import { fitDistance, placeOfText, placeToText, turned } from '@/scene/views';

const defaults = defaultParameters('v'.repeat(64), 60);
const other: JobParameters = {
  ...defaults,
  iso: -300.5,
  scheme: 5,
  interpolation: 'midpoint',
  passes: 0,
  smoothing: 'taubin',
  lambda: 0.5,
  pass_band: 0.05,
  normals: true,
  close: true,
  components: { keep: 2, min_triangles: null },
  max_displacement_mm: 0.25,
  formats: ['glb', 'stl'],
  draco: { position_bits: 11, speed: 3 },
  priority: 'stat',
};

describe('parameters in the address', () => {
  it('come back as they were', () => {
    const query = new URLSearchParams(queryOfParameters(other, defaults));
    expect(parametersOfQuery(query, defaults)).toEqual(other);
  });

  it('are left out where they are the defaults, but for the iso-value', () => {
    const said = Object.entries(queryOfParameters(defaults, defaults)).filter(([, value]) => value !== '');
    expect(said).toEqual([['iso', '60']]);
  });

  it('do no harm when they were typed wrongly', () => {
    const query = new URLSearchParams(
      'iso=abc&scheme=7&passes=-1&lambda=0&close=1&formats=exe&position_bits=99&speed=1.5&priority=now&smoothing=x&interpolation=',
    );
    expect(parametersOfQuery(query, defaults)).toEqual(defaults);
  });
});

describe('routes', () => {
  it('come back as they were', () => {
    const query = new URLSearchParams({ iso: '60', at: '1,2,3' });
    const route = parseRoute(hashOf(['volumes', 'a/b c'], query));
    expect(route.path).toEqual(['volumes', 'a/b c']);
    expect(route.query.get('at')).toBe('1,2,3');
    expect(parseRoute('').path).toEqual([]);
    expect(parseRoute('#/%E0%A4%A').path).toEqual(['%E0%A4%A']);
  });
});

describe('snippets', () => {
  it('say what is not the default, and nothing else', () => {
    expect(jobRequest(defaults)).toEqual({ volume: defaults.volume, iso: 60, formats: ['glb'] });
    const text = commandSnippet('http://h:1', other, true);
    for (const option of ['--iso -300.5', '--scheme 5', '--passes 0', '--lambda 0.5', '--close', '--keep-components 2', '--format glb,stl', '--token']) {
      expect(text).toContain(option);
    }
    expect(commandSnippet('http://h:1', defaults, false)).not.toContain('--scheme');
  });

  it('have a value on the command line for each option that takes one', () => {
    expect(commandSnippet('http://h:1', other, false)).toContain('--pass-band 0.05 --max-displacement 0.25 --close --keep');
  });

  it('hold a body that is the job', () => {
    const text = curlSnippet('http://h:1', other, false);
    const body = /-d '(.*)'$/m.exec(text)?.[1] ?? '';
    expect(JSON.parse(body)).toEqual(jobRequest(other));
    expect(text).not.toContain('Authorization');
    expect(librarySnippet('http://h:1', other, false)).toContain(body);
    expect(librarySnippet('http://h:1', other, true)).toContain('getenv("ISOMESH_TOKEN")');
    expect(librarySnippet('http://h:1', other, false)).toMatch(/job\.mesh->empty\) throw .*\nclient\.fetch\(/);
  });

  it('are programs in Python and JavaScript', () => {
    const text = pythonSnippet('http://h:1', other, true);
    // What Python itself reads of the call.
    const read = [
      'import ast, json, sys',
      'call = [one for one in ast.walk(ast.parse(sys.stdin.read())) if isinstance(one, ast.Call) and getattr(one.func, "attr", "") == "submit"][0]',
      'print(json.dumps({"volume": ast.literal_eval(call.args[0]), **{one.arg.rstrip("_"): ast.literal_eval(one.value) for one in call.keywords}}))',
    ].join('\n');
    expect(JSON.parse(execFileSync('python3', ['-c', read], { input: text }).toString())).toEqual(jobRequest(other));
    expect(text).toContain('os.environ["ISOMESH_TOKEN"]');
    expect(text).toContain('client.download(job, "mesh.stl")');
    expect(text).toContain('import os, isomesh_client\n');
    const script = javascriptSnippet('http://h:1', other, false);
    expect(JSON.parse(/submitJob\((.*)\);/.exec(script)?.[1] ?? '')).toEqual(jobRequest(other));
    expect(script).toContain("client.meshOf(job, 'stl')");
    expect(script).not.toContain('token');
  });

  it('do not repeat whom to call', () => {
    const called: JobParameters = { ...other, callback: { url: 'https://h/?secret=1' } };
    for (const text of [curlSnippet, commandSnippet, librarySnippet, pythonSnippet, javascriptSnippet].map((snippet) => snippet('http://h:1', called, false))) {
      expect(text).not.toContain('secret');
    }
    expect(JSON.stringify(queryOfParameters(called, defaults))).not.toContain('secret');
  });
});

describe('the kind of smoothing', () => {
  const smoothing = parameterOf('smoothing');
  // As the daemon answers: with the step that each kind has by itself.
  const laplacian: JobParameters = { ...defaults, lambda: 1 };
  const taubin: JobParameters = { ...defaults, smoothing: 'taubin', lambda: 0.33 };

  it('has a step of its own, which is left to the daemon', () => {
    expect(jobRequest(laplacian)).not.toHaveProperty('lambda');
    expect(jobRequest(taubin)).not.toHaveProperty('lambda');
    expect(queryOfParameters(laplacian, defaults).lambda).toBe('');
    expect(queryOfParameters(taubin, defaults).lambda).toBe('');
    expect(jobRequest({ ...laplacian, lambda: 0.33 })).toMatchObject({ lambda: 0.33 });
    expect(jobRequest({ ...taubin, lambda: 0.5 })).toMatchObject({ lambda: 0.5 });
  });

  it('takes no step along when it is switched', () => {
    // 1 would be refused, 0.33 would be a third of the smoothing without a word.
    expect(jobRequest(changed(laplacian, smoothing, 'taubin'))).toEqual({ ...jobRequest(defaults), smoothing: 'taubin' });
    expect(jobRequest(changed(taubin, smoothing, 'laplacian'))).toEqual(jobRequest(defaults));
    expect(changed({ ...taubin, lambda: 0.5, pass_band: 0.2 }, smoothing, 'laplacian')).toMatchObject({ lambda: null, pass_band: 0.1 });
    expect(changed({ ...taubin, lambda: 0.5 }, smoothing, 'taubin').lambda).toBe(0.5);
    expect(changed({ ...taubin, lambda: 0.5 }, parameterOf('passes'), 9).lambda).toBe(0.5);
  });

  it('is compared with the other by the steps of each', () => {
    expect(jobRequest(variantOf(taubin, { smoothing: 'laplacian' }))).toEqual(jobRequest(defaults));
    expect(isSameJob(laplacian, variantOf(laplacian, { smoothing: 'laplacian' }))).toBe(true);
    expect(isSameJob(laplacian, variantOf(laplacian, { smoothing: 'taubin' }))).toBe(false);
    expect(isSameJob(laplacian, variantOf(laplacian, { passes: 0 }))).toBe(false);
  });

  it('is kept by a variant of other parts', () => {
    const place = { components: { keep: null, min_triangles: null, nearest_to: [[1, 2, 3] as [number, number, number]] } };
    expect(jobRequest(variantOf({ ...taubin, components: { keep: 4, min_triangles: 9 } }, place))).toEqual({
      ...jobRequest(taubin),
      components: { nearest_to: [[1, 2, 3]] },
    });
  });

  it('decides which steps an address may hold', () => {
    const read = (query: string): JobParameters => parametersOfQuery(new URLSearchParams(query), defaults);
    expect(read('lambda=1&smoothing=taubin').lambda).toBe(null);
    expect(read('lambda=0.6&smoothing=taubin').lambda).toBe(0.6);
    expect(read('lambda=1').lambda).toBe(1);
  });

  it('keeps its pass band to itself', () => {
    expect(jobRequest({ ...taubin, pass_band: 0.2 })).toMatchObject({ pass_band: 0.2 });
    expect(jobRequest({ ...laplacian, pass_band: 0.2 })).not.toHaveProperty('pass_band');
  });
});

describe('jobs that are compared', () => {
  const jobs = (...all: Partial<JobParameters>[]): Job[] =>
    all.map((one) => ({ parameters: { ...defaults, ...one } }) as Job);

  it('are named by what differs, whichever parameter it is', () => {
    expect(titlesOf(jobs({ passes: 0 }, { passes: 5 }))).toEqual(['iso 60, 0 passes', 'iso 60, 5 passes']);
    expect(titlesOf(jobs({ max_displacement_mm: null }, { max_displacement_mm: 0.5 }))).toEqual([
      'iso 60, largest displacement: no limit',
      'iso 60, largest displacement: 0.5 mm',
    ]);
    expect(titlesOf(jobs({ formats: ['glb'] }, { formats: ['glb', 'stl'] }))).toEqual(['iso 60', 'iso 60']);
  });

  it('are named by their volumes if these differ', () => {
    const names = (volume: string): string => `volume ${volume}`;
    expect(titlesOf(jobs({ volume: 'a' }, { volume: 'b' }), names)).toEqual(['volume a, iso 60', 'volume b, iso 60']);
    expect(titlesOf(jobs({}, {}), names)).toEqual(['iso 60', 'iso 60']);
  });

  it('say yes or no for switches, and nothing about what is not for all of them', () => {
    expect(titlesOf(jobs({ certify: true }, { certify: false }))).toEqual([
      expect.stringMatching(/^iso 60, [a-z ]+: yes$/),
      expect.stringMatching(/^iso 60, [a-z ]+: no$/),
    ]);
    const atIso = { ...defaults, iso: 100 };
    const byLabels = { ...defaults, labels: 'all', passes: defaults.passes, background: 0, label_names: {}, label_colors: {}, label_values: {} } as JobParameters;
    expect(titlesOf(jobs(atIso, byLabels))).toEqual(['iso 100', 'all labels']);
    expect(titlesOf(jobs({ smoothing: 'laplacian' }, { smoothing: 'taubin', pass_band: 0.2 }))).toEqual(['iso 60, laplacian', 'iso 60, taubin']);
  });
});

describe('slices', () => {
  it('are fetched over the common window while that is precise enough', () => {
    const common: [number, number] = [0, 1000];
    expect(windowToFetch([100, 900], 300, common)).toEqual(common);
    expect(windowToFetch([300, 350], 320, common)).toEqual([300, 350]);
    // The contour is drawn from the same values, so that they reach the iso-value.
    const [low, high] = windowToFetch([300, 350], 400, common);
    expect(low).toBe(300);
    expect(high).toBeGreaterThan(400);
    expect(windowToFetch([-500, 900], 300, common)[0]).toBe(-500);
  });

  it('have windows with the digits that their width needs', () => {
    const common: [number, number] = [1_000_000, 1_000_009];
    const [low, high] = windowToFetch([1_000_004.1, 1_000_004.3], 1_000_004.2, common);
    expect(low).toBeCloseTo(1_000_004.02, 4);
    expect(high).toBeCloseTo(1_000_004.38, 4);
    expect(textOfWindow(common)).toBe('1000000,1000009');
    expect(windowOfText(textOfWindow([1_000_004.1, 1_000_004.3]))).toEqual([1_000_004.1, 1_000_004.3]);
    expect(textOfWindow([-1024.123456, 3071])).toBe('-1024.12,3071');
  });

  it('measure the iso-value in their own values', () => {
    expect(inSlice({ window: [-100, 155] }, 0)).toBe(100);
  });

  it('widen and move the window by dragging', () => {
    const wider = draggedWindow([0, 100], 100, 0);
    expect(wider[1] - wider[0]).toBeGreaterThan(100);
    expect((wider[0] + wider[1]) / 2).toBeCloseTo(50);
    expect(draggedWindow([0, 100], 0, -40)[0]).toBeCloseTo(10);
  });
});

describe('cameras', () => {
  it('come back from an address', () => {
    const place = { offset: [1, -2, 3.5] as [number, number, number], target: [0, 0, 7] as [number, number, number] };
    expect(placeOfText(placeToText(place))).toEqual(place);
    expect(placeOfText('1,2,3')).toBe(null);
    expect(placeOfText('0,0,0,1,1,1')).toBe(null);
    expect(placeOfText('')).toBe(null);
  });

  it('turn around the middle and stop at the poles', () => {
    const [x, y, z] = turned([0, -10, 0], Math.PI / 2, 0);
    expect([x, y, z].map((value) => Math.round(value))).toEqual([10, 0, 0]);
    expect(turned([0, -10, 0], 0, 5)[2]).toBeCloseTo(10, 3);
    expect(Math.hypot(...turned([3, 4, 0], 1, 1))).toBeCloseTo(5);
  });

  it('stand back just as far as a box needs, in narrow views too', () => {
    const angle = Math.PI / 6;
    const tangent = Math.tan(angle / 2);
    // Seen from the front, its near face fills the view.
    expect(fitDistance([2, 4, 3], [0, -5, 0], angle, 1)).toBeCloseTo(2 + 1.5 / tangent);
    expect(fitDistance([2, 4, 3], [0, -1, 0], angle, 0.25)).toBeCloseTo(2 + 1 / (0.25 * tangent));
    expect(fitDistance([2, 4, 3], [1e-9, 0, 7], angle, 1)).toBeCloseTo(1.5 + 2 / tangent);
    expect(fitDistance([0, 0, 0], [0, -1, 0], angle, 1)).toBeGreaterThan(0);
  });
});

describe('formats for people', () => {
  it('are short and whole', () => {
    expect(formatBytes(999)).toBe('999 B');
    expect(formatBytes(1_234_567)).toBe('1.2 MB');
    expect(formatBytes(999_999)).toBe('1.0 MB');
    expect(formatCount(1234567)).toBe('1\u202f234\u202f567');
    expect(formatValue(0.25)).toBe('0.25');
    expect(formatValue(-300)).toBe('\u2212300');
    expect(formatMilliseconds(0.2)).toBe('< 1 ms');
    expect(formatMilliseconds(1234)).toBe('1.23 s');
    expect(formatMilliseconds(125_000)).toBe('2 min 5 s');
  });
});

describe('raw samples', () => {
  it('have to account for every byte', () => {
    expect(rawFault(48, [2, 3, 4], 'int16')).toBe('');
    expect(rawFault(47, [2, 3, 4], 'int16')).toMatch(/48 bytes/);
    expect(rawFault(48, [2, 3, Number.NaN], 'int16')).toMatch(/positive whole number/);
  });
});
