// A job's parameters as the page keeps them: in the address, in the form, and in snippets.
import { meshFormats, priorities, type JobParameters, type MeshFormat } from '../api/types';

// The contract's defaults, but for the format: GLB is what the page shows.
export function defaultParameters(volume: string, iso: number): JobParameters {
  return {
    volume,
    iso,
    scheme: 6,
    interpolation: 'linear',
    passes: 5,
    smoothing: 'laplacian',
    lambda: null,
    max_displacement_mm: null,
    components: { keep: null, min_triangles: null },
    close: false,
    formats: ['glb'],
    draco: { position_bits: 14, speed: 7 },
    priority: 'routine',
  };
}

const within = (value: number, low: number, high: number): boolean => value >= low && value <= high;

// Takes over what the query says and is valid; a link that was typed wrongly does no harm.
export function parametersOfQuery(query: URLSearchParams, defaults: JobParameters): JobParameters {
  const components = { keep: null, min_triangles: null, ...defaults.components };
  const result: JobParameters = { ...defaults, draco: { ...defaults.draco }, components };
  const number = (name: string, accept: (value: number) => boolean, set: (value: number) => void): void => {
    const text = query.get(name);
    if (text === null || text.trim() === '') return;
    const value = Number(text);
    if (Number.isFinite(value) && accept(value)) set(value);
  };
  const whole = (low: number, high: number) => (value: number) =>
    Number.isInteger(value) && within(value, low, high);
  number('iso', () => true, (value) => (result.iso = value));
  number('scheme', whole(5, 6), (value) => (result.scheme = value === 5 ? 5 : 6));
  number('passes', whole(0, 1000), (value) => (result.passes = value));
  number('lambda', (value) => value > 0 && value <= 1, (value) => (result.lambda = value));
  number('max_displacement_mm', (value) => value >= 0, (value) => (result.max_displacement_mm = value));
  number('keep', whole(1, 4_294_967_295), (value) => (components.keep = value));
  number('min_triangles', whole(1, 4_294_967_295), (value) => (components.min_triangles = value));
  number('position_bits', whole(8, 30), (value) => (result.draco.position_bits = value));
  number('speed', whole(0, 10), (value) => (result.draco.speed = value));
  const interpolation = query.get('interpolation');
  if (interpolation === 'linear' || interpolation === 'midpoint') result.interpolation = interpolation;
  const smoothing = query.get('smoothing');
  if (smoothing === 'laplacian' || smoothing === 'taubin') result.smoothing = smoothing;
  if (query.get('close') === 'true') result.close = true;
  const priority = priorities.find((value) => value === query.get('priority'));
  if (priority) result.priority = priority;
  const formats = query.get('formats')?.split(',') ?? [];
  const known = meshFormats.filter((format) => formats.includes(format));
  if (known.length > 0) result.formats = withGlb(known);
  return result;
}

export function withGlb(formats: readonly MeshFormat[]): MeshFormat[] {
  return meshFormats.filter((format) => format === 'glb' || formats.includes(format));
}

// What differs from the defaults, as texts for a query; '' where it does not.
export function queryOfParameters(
  parameters: JobParameters,
  defaults: JobParameters,
): Record<string, string> {
  const flat = (value: JobParameters): Record<string, string> => ({
    iso: String(value.iso),
    scheme: String(value.scheme),
    interpolation: value.interpolation,
    passes: String(value.passes),
    smoothing: value.smoothing,
    lambda: String(value.lambda ?? ''),
    max_displacement_mm: String(value.max_displacement_mm ?? ''),
    keep: String(value.components?.keep ?? ''),
    min_triangles: String(value.components?.min_triangles ?? ''),
    close: String(value.close),
    formats: value.formats.join(','),
    position_bits: String(value.draco.position_bits),
    speed: String(value.draco.speed),
    priority: value.priority,
  });
  const standard = flat(defaults);
  const entries = Object.entries(flat(parameters));
  return Object.fromEntries(
    entries.map(([name, value]) => [name, name !== 'iso' && value === standard[name] ? '' : value]),
  );
}

// The members of a job that have to be said: those that are not the contract's defaults.
export function memorable(parameters: JobParameters): Partial<JobParameters> {
  const { scheme, interpolation, passes, smoothing, lambda, close, draco, priority } = parameters;
  const { components, pass_band, max_displacement_mm } = parameters;
  const standard = defaultParameters('', 0);
  const members: Partial<JobParameters> = { volume: parameters.volume, iso: parameters.iso };
  if (scheme !== standard.scheme) members.scheme = scheme;
  if (interpolation !== standard.interpolation) members.interpolation = interpolation;
  if (passes !== standard.passes) members.passes = passes;
  if (smoothing !== standard.smoothing) members.smoothing = smoothing;
  if (lambda !== null && (smoothing !== 'laplacian' || lambda !== 1)) members.lambda = lambda;
  if (pass_band !== undefined && smoothing === 'taubin') members.pass_band = pass_band;
  if (max_displacement_mm != null) members.max_displacement_mm = max_displacement_mm;
  if (close) members.close = close;
  if (components && (components.keep !== null || components.min_triangles !== null)) {
    members.components = components;
  }
  if (draco.position_bits !== standard.draco.position_bits || draco.speed !== standard.draco.speed) {
    members.draco = draco;
  }
  if (priority !== standard.priority) members.priority = priority;
  members.formats = parameters.formats;
  return members;
}

// In a few words, for titles: 6 tetrahedra, linear, 5 passes.
export function inWords(parameters: JobParameters): string {
  const passes = parameters.passes === 1 ? '1 pass' : `${parameters.passes} passes`;
  const smoothing = parameters.smoothing === 'taubin' && parameters.passes > 0 ? ' (Taubin)' : '';
  const closed = parameters.close ? ', closed' : '';
  return `${parameters.scheme} tetrahedra, ${parameters.interpolation}, ${passes}${smoothing}${closed}`;
}
