// How to do the same without the page.
import type { JobParameters } from '../api/types';
import { meshFileSuffix } from '../ui/format';
import { filesOf, jobRequest, toSay } from './parameters';
import { asText, isByLabels, valueIn, type ByLabel, type Parameter, type Places } from './table';

function quoted(text: string): string {
  return /^[A-Za-z0-9_./:=,-]+$/.test(text) ? text : `'${text.replaceAll("'", `'\\''`)}'`;
}

function fileName(format: string): string {
  return `mesh.${meshFileSuffix(format)}`;
}

export function curlSnippet(origin: string, job: JobParameters, hasToken: boolean): string {
  const lines = [`curl --fail-with-body ${quoted(`${origin}/v1/jobs?wait=30`)}`];
  if (hasToken) lines.push(`-H "Authorization: Bearer $ISOMESH_TOKEN"`);
  lines.push(`-H 'Content-Type: application/json'`);
  lines.push(`-d ${quoted(JSON.stringify(jobRequest(job)))}`);
  const auth = hasToken ? ' -H "Authorization: Bearer $ISOMESH_TOKEN"' : '';
  const line = (name: string, format: string): string =>
    `curl --fail --remove-on-error${auth} -o ${name} ${quoted(`${origin}/v1/jobs/`)}JOB/mesh.${format}`;
  const downloads = filesOf(job).map((format) => line(fileName(format), format));
  // An OBJ of labels names the file of its colours.
  if (isByLabels(job) && filesOf(job).includes('obj')) downloads.push(line('mesh.mtl', 'mtl'));
  return [`${lines.join(' \\\n  ')}`, '# JOB is the id in the answer; its files have no triangles if "empty" is true there', ...downloads].join('\n');
}

function optionFor(parameter: Parameter, job: JobParameters): string {
  const value = valueIn(job, parameter);
  if (parameter.kind === 'by label') {
    const each = Object.entries(value as ByLabel);
    return each.map(([label, of]) => `--${parameter.option} ${quoted(`${label}=${String(of)}`)}`).join(' ');
  }
  if (parameter.kind === 'places' && parameter.name !== 'crop') {
    return (value as Places).map((place) => `--${parameter.option} ${place.join(',')}`).join(' ');
  }
  if (value === false) return `--no-${parameter.option}`;
  return value === true ? `--${parameter.option}` : `--${parameter.option} ${quoted(asText(value))}`;
}

export function commandSnippet(origin: string, job: JobParameters, hasToken: boolean): string {
  const token = hasToken ? ' --token "$ISOMESH_TOKEN"' : '';
  const isomesh = `isomesh --server ${quoted(origin)}${token}`;
  const options = toSay(job)
    .filter(({ name }) => name !== 'volume')
    .map((parameter) => optionFor(parameter, job));
  const fetched = filesOf(job).map((format) => `-o ${fileName(format)}`).join(' ');
  return [
    `job=$(${isomesh} submit ${job.volume} \\`,
    `  ${options.join(' ')})`,
    `${isomesh} wait "$job"`,
    `${isomesh} fetch "$job" ${fetched}`,
  ].join('\n');
}

// As Python writes it.
function python(value: unknown): string {
  if (value === null) return 'None';
  if (typeof value === 'boolean') return value ? 'True' : 'False';
  if (Array.isArray(value)) return `[${value.map(python).join(', ')}]`;
  if (typeof value === 'object') return `{${Object.entries(value).map(([name, inner]) => `${JSON.stringify(name)}: ${python(inner)}`).join(', ')}}`;
  return JSON.stringify(value);
}

export function pythonSnippet(origin: string, job: JobParameters, hasToken: boolean): string {
  const { volume, ...others } = jobRequest(job);
  // lambda is a word of Python's own.
  const options = Object.entries(others).map(([name, value]) => `    ${name === 'lambda' ? 'lambda_' : name}=${python(value)},`);
  return [
    hasToken ? 'import os, isomesh_client' : 'import isomesh_client',
    `client = isomesh_client.Client(${JSON.stringify(origin)}${hasToken ? ', token=os.environ["ISOMESH_TOKEN"]' : ''})`,
    'job = client.wait(client.submit(',
    `    ${JSON.stringify(volume)},`,
    ...options,
    '))',
    ...filesOf(job).map((format) => `client.download(job, "${fileName(format)}")`),
  ].join('\n');
}

export function javascriptSnippet(origin: string, job: JobParameters, hasToken: boolean): string {
  const token = hasToken ? ', token: process.env.ISOMESH_TOKEN' : '';
  return [
    `import { writeFile } from 'node:fs/promises';`,
    `import { Client } from 'isomesh';`,
    `const client = new Client({ server: ${JSON.stringify(origin)}${token} });`,
    `const { id } = await client.submitJob(${JSON.stringify(jobRequest(job))});`,
    'const job = await client.follow(id);',
    'if (job.state !== \'succeeded\') throw new Error(job.error?.detail ?? job.state);',
    ...filesOf(job).map((format) => `await writeFile('${fileName(format)}', new Uint8Array(await client.meshOf(job, '${format}')));`),
  ].join('\n');
}

// The enumerator in C++: Glb for glb.
function enumeratorOf(name: string): string {
  return `k${name.charAt(0).toUpperCase()}${name.slice(1)}`;
}

export function librarySnippet(origin: string, job: JobParameters, hasToken: boolean): string {
  const token = hasToken ? ', .token = std::getenv("ISOMESH_TOKEN")' : '';
  const fetched = filesOf(job).map(
    (format) => `client.fetch(job.id, isomesh::MeshFormat::${enumeratorOf(format)}, "${fileName(format)}");`,
  );
  return [
    `isomesh::Client client({.server = ${JSON.stringify(origin)}${token}});`,
    `const auto parameters = isomesh::parse_job_parameters(R"(`,
    `  ${JSON.stringify(jobRequest(job))})");`,
    'const isomesh::Job job = client.wait(client.submit(parameters).id);',
    'if (job.mesh && job.mesh->empty) throw std::runtime_error(job.mesh->empty_reason.value_or("the surface is empty"));',
    ...fetched,
  ].join('\n');
}
