// Exports beside the files of a job: for a 3D printer, for a phone, and the certificate of the measurements.
import type { Job, Volume } from '../../api/types';
import { withShownGlb } from '../../job/parameters';
import { certificateFile, isForPrinting } from '../../job/printing';
import { isByLabels } from '../../job/table';
import { fileNameOf, makePrintable, makeVariant } from '../../job/variants';
import { viewableFile } from '../../mesh/shown';
import { button, h } from '../../ui/dom';
import { tellError } from '../../ui/notices';
import { saveBlob } from '../../ui/save';

// The number of triangles that a phone can show.
const triangles = 150_000;

export function exportActions(job: Job, volume: Volume | null): HTMLElement | null {
  const { mesh, parameters } = job;
  const make = makeVariant(job);
  const nameOf = (suffix: string): string => fileNameOf(job, volume, suffix);
  if (!mesh || mesh.empty) return null;
  const usdz = async (): Promise<void> => {
    if (mesh.triangles > triangles) {
      make({ triangles, ...withShownGlb(parameters) });
      return;
    }
    phone.disabled = true;
    try {
      const { usdzOf } = await import('../../mesh/usdz');
      saveBlob(await usdzOf(job, new AbortController().signal), nameOf('.usdz'));
    } catch (error) {
      tellError(error);
    } finally {
      phone.disabled = false;
    }
  };
  const isLarge = mesh.triangles > triangles;
  const phone = button(isLarge ? 'Simplify for a phone' : 'USDZ for a phone', () => void usdz(), {
    class: 'chip',
    title: isLarge ? 'Starts a job with fewer triangles; save its surface as USDZ afterwards' : 'Saves a file that phones show in augmented reality (AR)',
  });
  const canMake = volume !== null;
  return h('div.make.exports', [
    canMake &&
      !isForPrinting(job) &&
      !isByLabels(parameters) &&
      button('For 3D printing', () => makePrintable(job, volume.spacing), {
        class: 'chip',
        title: 'Starts a job that keeps the largest component, fills cavities, closes the surface, proves its error, and makes STL and 3MF',
      }),
    viewableFile(job) !== null && (canMake || !isLarge) && phone,
    mesh.certificate &&
      button('Certificate', () => saveBlob(new Blob([certificateFile(job)], { type: 'application/json' }), nameOf('-certificate.json')), {
        class: 'chip',
        title: 'Saves the measurements and the SHA-256 of each file',
      }),
  ]);
}
