// node generate.mjs [--types]: what the page takes over from proto/openapi.yaml, written to generated/ beside this
// file. parameters.ts holds the table of a job's parameters. With --types, api.d.ts holds the types of requests and answers:
// checks need them, and a build of the page does not.
import { existsSync, mkdirSync, readFileSync, renameSync, writeFileSync } from 'node:fs';
import { parse } from 'yaml';

const source = new URL('../../proto/openapi.yaml', import.meta.url);
const folder = new URL('generated/', import.meta.url);
const { components } = parse(readFileSync(source, 'utf8'));

// The schema with the keywords of what it refers to; its own keywords go before those.
function resolved({ $ref, allOf = [], ...own }) {
  const named = $ref ? [components.schemas[$ref.replace('#/components/schemas/', '')]] : [];
  return Object.assign({}, ...[...named, ...allOf].map(resolved), own);
}

function kindOf(name, { type, enum: values, items, oneOf = [], additionalProperties }) {
  const types = [type].flat();
  if (values) return 'choice';
  if (oneOf.some((one) => one.const === 'all')) return 'labels';
  if (types.includes('object') && typeof additionalProperties === 'object') return 'by label';
  if (types.includes('array') && items && resolved(items).enum) return 'choices';
  if (types.includes('array') && items) return items.type === 'array' ? 'places' : 'numbers';
  for (const [known, kind] of Object.entries({ boolean: 'switch', integer: 'integer', number: 'number', string: 'text' })) {
    if (types.includes(known)) return kind;
  }
  throw new Error(`${name}: the page has no control for a parameter of this kind`);
}

// What differs with the value of another parameter: x-by-OTHER.
function differencesOf(schema) {
  const key = Object.keys(schema).find((name) => name.startsWith('x-by-'));
  return key && { parameter: key.slice('x-by-'.length), cases: schema[key] };
}

function optionOf(query, unit) {
  return query.replace(new RegExp(`_${unit}$`), '').replaceAll('_', '-');
}

function parameterOf(name, schema) {
  // The iso-value may be a word as well; the page has numbers only.
  const { oneOf: [choice] = [], ...rest } = schema;
  const all = { ...rest, ...choice };
  const query = all['x-query'] ?? name.split('.').at(-1);
  return {
    name,
    kind: kindOf(name, { ...all, oneOf: schema.oneOf }),
    title: all.title ?? name,
    help: (all.description ?? '').replaceAll('`', '').replace(/\s+/g, ' ').trim(),
    unit: all['x-unit'] ?? '',
    query,
    option: all['x-option'] ?? optionOf(query, all['x-unit']),
    isNullable: [all.type].flat().includes('null'),
    default: all.default,
    values: all.enum ?? (all.items && resolved(all.items).enum),
    valueHelp: all['x-enumDescriptions'],
    minimum: all.minimum,
    above: all.exclusiveMinimum,
    maximum: all.maximum,
    jobs: all['x-jobs'] ?? 'any',
    byLabels: all['x-default-by-labels'],
    by: differencesOf(all),
  };
}

function parametersOf(schema, prefix = '') {
  return Object.entries(schema.properties).flatMap(([member, given]) => {
    const inner = resolved(given);
    const name = prefix + member;
    return inner.properties ? parametersOf(inner, `${name}.`) : [parameterOf(name, inner)];
  });
}

// In one step, because the page's checks and a build of the daemon may run side by side.
function write(name, text) {
  const file = new URL(name, folder);
  if (existsSync(file) && readFileSync(file, 'utf8') === text) return;
  const unfinished = new URL(`${name}.${process.pid}`, folder);
  writeFileSync(unfinished, text);
  renameSync(unfinished, file);
}

const made = '// Made by generate.mjs of proto/openapi.yaml.\n';
const table = JSON.stringify(parametersOf(components.schemas.JobParameters), null, 2);
const { enum: formatNames, 'x-titles': titles, 'x-suffixes': suffixes } = components.schemas.VolumeFormat;
const volumes = JSON.stringify(
  formatNames.map((name) => ({ name, title: titles[name], suffixes: suffixes[name].split(' ') })),
  null,
  2,
);
const stages = JSON.stringify(components.schemas.Stage.enum.filter((name) => name !== 'done'));
const whole = JSON.stringify(components.schemas.MeshFormat['x-hold-all-labels']);
const meshTitles = JSON.stringify(components.schemas.MeshFormat['x-titles'], null, 2);
const meshSuffixes = JSON.stringify(components.schemas.MeshFormat['x-file-suffixes'], null, 2);
mkdirSync(folder, { recursive: true });
write(
  'parameters.ts',
  `${made}import type { Parameter } from '../src/job/table';\n\nexport const parameters: readonly Parameter[] = ${table};

// One file of these holds all labels.
export const wholeFormats: readonly string[] = ${whole};

// What people call the formats of mesh files.
export const meshFormatTitles: Readonly<Record<string, string>> = ${meshTitles};

// The ends of names of mesh files that are not the format's name.
export const meshFileSuffixes: Readonly<Record<string, string>> = ${meshSuffixes};

// The stages of a job, in their order.
export const stages: readonly string[] = ${stages};

// The formats in which volumes are uploaded.
export const volumeFormats: readonly { name: string; title: string; suffixes: readonly string[] }[] = ${volumes};\n`,
);
if (process.argv.includes('--types')) {
  const { default: openapiTS, astToString } = await import('openapi-typescript');
  const types = await openapiTS(source, { arrayLength: true, defaultNonNullable: false });
  write('api.d.ts', made + astToString(types));
}
