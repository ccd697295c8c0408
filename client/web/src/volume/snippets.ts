// How to do the same without the page.
import type { JobParameters } from '../api/types';
import { memorable } from './parameters';

function quoted(text: string): string {
  return /^[A-Za-z0-9_./:=,-]+$/.test(text) ? text : `'${text.replaceAll("'", `'\\''`)}'`;
}

export function curlSnippet(origin: string, parameters: JobParameters, hasToken: boolean): string {
  const lines = [`curl ${quoted(`${origin}/v1/jobs?wait=30`)}`];
  if (hasToken) lines.push(`-H "Authorization: Bearer $ISOMESH_TOKEN"`);
  lines.push(`-H 'Content-Type: application/json'`);
  lines.push(`-d ${quoted(JSON.stringify(memorable(parameters)))}`);
  const auth = hasToken ? ' -H "Authorization: Bearer $ISOMESH_TOKEN"' : '';
  const downloads = parameters.formats.map(
    (format) => `curl${auth} -o mesh.${format} ${quoted(`${origin}/v1/jobs/`)}JOB/mesh.${format}`,
  );
  return [`${lines.join(' \\\n  ')}`, '# JOB is the id in the answer', ...downloads].join('\n');
}

export function commandSnippet(origin: string, parameters: JobParameters, hasToken: boolean): string {
  const options = [`--server ${quoted(origin)}`];
  if (hasToken) options.push('--token "$ISOMESH_TOKEN"');
  const job = [`--iso ${parameters.iso}`];
  const say = memorable(parameters);
  if (say.scheme !== undefined) job.push(`--scheme ${say.scheme}`);
  if (say.interpolation !== undefined) job.push(`--interpolation ${say.interpolation}`);
  if (say.passes !== undefined) job.push(`--passes ${say.passes}`);
  if (say.smoothing !== undefined) job.push(`--smoothing ${say.smoothing}`);
  if (say.lambda !== undefined) job.push(`--lambda ${say.lambda}`);
  if (say.max_displacement_mm != null) job.push(`--max-displacement ${say.max_displacement_mm}`);
  if (say.close) job.push('--close');
  if (say.components?.keep != null) job.push(`--keep-components ${say.components.keep}`);
  if (say.components?.min_triangles != null) {
    job.push(`--min-triangles ${say.components.min_triangles}`);
  }
  if (say.draco) {
    job.push(`--position-bits ${say.draco.position_bits}`, `--speed ${say.draco.speed}`);
  }
  if (say.priority !== undefined) job.push(`--priority ${say.priority}`);
  const formats = parameters.formats.join(',');
  const fetched = parameters.formats.map((format) => `-o mesh.${format}`).join(' ');
  const isomesh = `isomesh ${options.join(' ')}`;
  return [
    `job=$(${isomesh} submit ${parameters.volume} \\`,
    `  ${job.join(' ')} --format ${formats})`,
    `${isomesh} wait "$job"`,
    `${isomesh} fetch "$job" ${fetched}`,
  ].join('\n');
}
