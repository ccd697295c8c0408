// Other jobs from one: the same surface with changes, where its parameters are chosen, what its files are called.
import { client } from '../client';
import { errorOfProblem } from '../api/problem';
import { isFinal, type Job, type JobParameters, type Label, type MeshFormat, type Volume } from '../api/types';
import { meshFileSuffix, meshFormatTitle, shortId } from '../ui/format';
import { ask, tell, tellError } from '../ui/notices';
import { go, hashOf } from '../ui/route';
import { saveFile } from '../ui/save';
import { fileStem } from '../volume/names';
import { labelsOfMesh } from './labels';
import { defaultParameters, isSameJob, jobRequest, queryOfParameters, surfaceInNames, surfaceInWords, variantOf, withGlb } from './parameters';
import { forPrinting } from './printing';

// Finds a surface among the newest of its volume that was made with these parameters, or makes it.
async function found(parameters: JobParameters): Promise<Job> {
  const { jobs } = await client.listJobs('', { state: 'succeeded', volume: parameters.volume });
  return jobs.find((made) => isSameJob(made.parameters, parameters)) ?? client.submitJob(jobRequest(parameters));
}

// The same surface with other parameters.
export function submitVariant({ parameters }: Job, variant: Partial<JobParameters>): Promise<Job> {
  return found(variantOf(parameters, variant));
}

// The same surface, for a printer.
export function makePrintable({ parameters }: Job, spacing: readonly number[]): void {
  found(forPrinting(parameters, spacing)).then(started, tellError);
}

function started({ id, state }: Job): void {
  tell(isFinal(state) ? 'This surface was made before.' : 'A new job was started.');
  go(['jobs', id]);
}

export type MakeVariant = (variant: Partial<JobParameters>) => void;

// Starts a job with these changes and goes to it.
export function makeVariant(job: Job): MakeVariant {
  return (variant) => void submitVariant(job, variant).then(started, tellError);
}

// Saves the same surface with these changes in that format; a job makes the file first. `label` is one of several whose files are
// apart in that format.
export async function saveVariant(job: Job, volume: Volume | null, format: MeshFormat, change: Partial<JobParameters> = {}, label: Label | null = null): Promise<void> {
  const title = meshFormatTitle(format);
  const alone = change.labels ? ` of ${surfaceInWords(change)} without the others, so that the surface may differ` : '';
  tell(`Making ${title}${alone}. It is saved when it is ready.`);
  try {
    const { id } = await submitVariant(job, { ...change, formats: withGlb([format]) });
    const made = await client.follow(id);
    if (made.error) throw errorOfProblem(made.error);
    const own = label !== null && (await labelsOfMesh(made)).find((one) => one.label === label)?.files?.[format];
    const whole = made.mesh?.files[format];
    const file = own || whole || made.mesh?.files.zip;
    if (!file) throw new Error(`The job was cancelled before it made ${title}.`);
    const suffix = `${own ? `-${label}` : ''}.${meshFileSuffix(own || whole ? format : 'zip')}`;
    await saveFile(file.href, fileNameOf(made, volume, suffix), file.bytes);
  } catch (error) {
    tellError(error);
  }
}

// Asks first. Resolves with true once the job and its files are erased.
export async function eraseJob(job: Job): Promise<boolean> {
  const title = job.mesh ? 'Erase this surface?' : 'Erase this job?';
  if (!(await ask(title, `${surfaceInWords(job.parameters)}: the job and its files will be removed from the server. The volume stays.`, 'Erase'))) return false;
  try {
    await client.eraseJob(job.id);
    tell(job.mesh ? 'The surface was erased.' : 'The job was erased.');
    return true;
  } catch (error) {
    tellError(error);
    return false;
  }
}

// Asks once for all. Calls back with each that was erased; those that the server keeps stay.
export async function eraseJobs(ids: readonly string[], onErased: (id: string) => void): Promise<void> {
  if (!(await ask(`Erase ${ids.length} jobs?`, 'The jobs and their files will be removed from the server. The volumes stay.', 'Erase'))) return;
  try {
    for (const id of ids) {
      await client.eraseJob(id);
      onErased(id);
    }
  } catch (error) {
    tellError(error);
  }
}

// The file name of a surface: head-iso-60.glb.
export function fileNameOf(job: Job, volume: Volume | null, suffix: string): string {
  return `${fileStem(volume, `surface-${shortId(job.id)}`)}-${surfaceInNames(job.parameters)}${suffix}`;
}

// The address of the volume with this job's parameters chosen.
export function changeLink(job: Job): string {
  const defaults = defaultParameters(job.volume, 0);
  const entries = Object.entries(queryOfParameters(job.parameters, defaults)).filter(
    ([name, value]) => value !== '' && !(name === 'iso' && value === 'otsu'),
  );
  return hashOf(['volumes', job.volume], new URLSearchParams(entries));
}
