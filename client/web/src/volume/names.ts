// Names and notes of volumes for users.
import type { Volume } from '../api/types';
import { formatDims, volumeFormatTitle } from '../ui/format';

// A date of DICOM, 20240501, for people.
export function dateOf(text = ''): string {
  const [, year, month, day] = /^(\d{4})(\d{2})(\d{2})$/.exec(text) ?? [];
  return year === undefined ? '' : `${year}-${month}-${day}`;
}

// Patient, name and date of a volume, or its kind if none of these is known.
export function volumeName(volume: Volume): string {
  const { patient_name: patient, series_description: series, study_date: date } = volume.dicom ?? {};
  const own = (volume.name ?? series)?.trim();
  const told = [patient?.replaceAll('^', ' ').trim(), own, dateOf(date)].filter(Boolean);
  return told.length > 0 ? told.join(', ') : volumeKind(volume);
}

// The name of a file that is made from it, without its suffix. It never has the patient's name, since files are passed on.
export function fileStem(volume: Volume | null, otherwise: string): string {
  const own = (volume?.name ?? volume?.dicom?.series_description ?? '').replace(/\.(nii|nrrd|mha|mhd|vti|dcm|zip|tar|gz|tgz)\b/gi, '');
  const plain = own
    .normalize('NFKD')
    .replace(/[^\w.-]+/g, '-')
    .replace(/^[-.]+|[-.]+$/g, '');
  return plain === '' ? otherwise : plain.slice(0, 60);
}

export function volumeKind(volume: Volume): string {
  const kind = volume.modality ?? volumeFormatTitle(volume.format);
  return `${kind}, ${formatDims(volume.dims)}`;
}

// NIfTI and DICOM scale whole samples to values that are not.
export function isInteger({ type, range }: Pick<Volume, 'type' | 'range'>): boolean {
  return !type.startsWith('float') && range.every(Number.isInteger);
}

// Each of its values is one of a segmentation, as the server tells it.
export function areLabels(volume: Pick<Volume, 'type' | 'range' | 'notes'>): boolean {
  return isInteger(volume) && volume.notes.some(({ code }) => code === 'looks-like-labels');
}

export function spanOf({ range: [low, high] }: Pick<Volume, 'range'>): number {
  return high - low;
}

// The button that makes surfaces of labels. Only volumes of whole values have it.
export const eachLabel = 'Each label';

// The server does not know the page's buttons, so the page adds which one to use.
export function noteTexts(volume: Volume): string[] {
  return volume.notes.map(({ code, detail }) =>
    code === 'looks-like-labels' && isInteger(volume) ? `${detail} The button "${eachLabel}" makes one surface for each label.` : detail,
  );
}

// The form that a note on a NIfTI file says would place the samples differently. Null: it names none.
export function otherForm(detail: string): string | null {
  return /\bnifti_form=(sform|qform)\b/.exec(detail)?.[1] ?? null;
}

const mostNamed = 5;

// Says which files of an upload are part of no volume. '' if there are none. Each volume of an upload may list the same ones.
export function skippedText(volumes: readonly Pick<Volume, 'ignored'>[]): string {
  const names = [...new Set(volumes.flatMap(({ ignored }) => ignored.map(({ name }) => name)))];
  if (names.length === 0) return '';
  const more = names.length > mostNamed ? ` and ${names.length - mostNamed} more` : '';
  return `${names.length === 1 ? '1 file was' : `${names.length} files were`} skipped: ${names.slice(0, mostNamed).join(', ')}${more}`;
}
