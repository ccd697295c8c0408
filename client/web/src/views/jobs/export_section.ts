// Exports beside the files of a job: for a 3D printer, for a phone, and the certificate of the measurements.
import { client } from '../../client';
import type { Job, Volume } from '../../api/types';
import { isForPrinting } from '../../job/printing';
import { isByLabels } from '../../job/table';
import { makePrintable, saveVariant } from '../../job/variants';
import { button, h } from '../../ui/dom';
import { tellError } from '../../ui/notices';
import { saveReport } from './report';

// The number of triangles that a phone can show.
const triangles = 150_000;

export function exportActions(job: Job, volume: Volume | null): HTMLElement | null {
  const { mesh, parameters } = job;
  if (!mesh || mesh.empty) return null;
  const canMake = volume !== null;
  return h('div.make.exports', [
    canMake &&
      !isForPrinting(job) &&
      !isByLabels(parameters) &&
      button('For 3D printing', () => makePrintable(job, volume.spacing), {
        class: 'chip',
        title: 'Starts a job that keeps the largest component, fills cavities, closes the surface, proves its error, and makes STL and 3MF',
      }),
    canMake &&
      button('USDZ for a phone', () => void saveVariant(job, volume, 'usdz', mesh.triangles > triangles ? { triangles } : {}), {
        class: 'chip',
        title: 'Saves a file that phones show in augmented reality (AR), with fewer triangles if there are many',
      }),
    mesh.certificate &&
      button('Certificate', () => void client.reportOf(job.id).then(saveReport, tellError), {
        class: 'chip',
        title: 'Saves the measurements, how the error was proven, and the SHA-256 of each file',
      }),
  ]);
}
