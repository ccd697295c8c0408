// The job parameters of proto/openapi.yaml, read apart from the page's own way (client/web/generate.mjs).
import { readFileSync } from 'node:fs';
import { parse } from 'yaml';

export interface Schema {
  $ref?: string;
  allOf?: Schema[];
  properties?: Record<string, Schema>;
  type?: string | string[];
  enum?: (string | number)[];
  title?: string;
  default?: unknown;
  minimum?: number;
  exclusiveMinimum?: number;
  maximum?: number;
}

interface Description {
  paths: Record<string, { get?: { parameters: { $ref?: string; name?: string }[] } }>;
  components: { schemas: Record<string, Schema>; parameters: Record<string, { name: string }> };
}

const api = parse(
  readFileSync(new URL('../../proto/openapi.yaml', import.meta.url), 'utf8'),
) as Description;

function named<T>(from: Record<string, T>, ref: string): T {
  const found = from[ref.split('/').at(-1) ?? ''];
  if (!found) throw new Error(`${ref} is not there`);
  return found;
}

function whole(schema: Schema): Schema {
  if (schema.$ref) return whole(named(api.components.schemas, schema.$ref));
  return Object.assign({}, ...(schema.allOf ?? []).map(whole), schema) as Schema;
}

function leaves(schema: Schema, prefix: string): [string, Schema][] {
  return Object.entries(schema.properties ?? {}).flatMap(([name, given]) => {
    const member = whole(given);
    return member.properties ? leaves(member, `${prefix}${name}.`) : [[prefix + name, member] as [string, Schema]];
  });
}

// What a job can be asked for, by its place in the job: draco.speed.
export const jobParameters: ReadonlyMap<string, Schema> = new Map(
  leaves(whole({ $ref: 'JobParameters' }), ''),
);

// The name that the page shows.
export function titleOf(parameter: string): string {
  return jobParameters.get(parameter)?.title ?? parameter;
}

// What the query of an estimate may hold.
export const estimateNames: readonly string[] = (api.paths['/v1/estimate']?.get?.parameters ?? []).map(
  ({ $ref, name = '' }) => ($ref ? named(api.components.parameters, $ref).name : name),
);

// Whom to call when a job ends is for programs.
export const notOfThePage = ['callback.url'];
// The volume is chosen before, the iso-value in the histogram, labels in their list; what labels are
// called and are made of is the volume's.
export const notInTheForm = [
  'volume',
  'iso',
  'labels',
  'background',
  'label_names',
  'label_colors',
  'label_values',
  ...notOfThePage,
];
