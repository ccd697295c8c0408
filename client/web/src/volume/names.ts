// Volumes have no names on the server; what a file was called is kept as long as the tab, and never
// leaves it: names of files can name patients.
import type { Volume } from '../api/types';
import { formatDims, formatNames } from '../ui/format';

const key = (id: string): string => `isomesh.name.${id}`;

export function rememberName(id: string, name: string): void {
  sessionStorage.setItem(key(id), name);
}

// A date of DICOM, 20240501, for people.
function dateOf(text: string | undefined): string {
  const match = /^(\d{4})(\d{2})(\d{2})$/.exec(text ?? '');
  return match ? `${match[1]}-${match[2]}-${match[3]}` : '';
}

// What a person would call the volume: whose and which study it is, the file, or else what it holds.
export function volumeName(volume: Volume): string {
  const { patient_name: patient, series_description: series, study_date: date } = volume.dicom ?? {};
  const told = [patient?.replaceAll('^', ' ').trim(), series?.trim(), dateOf(date)].filter(Boolean);
  if (told.length > 0) return told.join(', ');
  return sessionStorage.getItem(key(volume.id)) ?? volumeKind(volume);
}

// Of a job's volume, which may be gone.
export function nameIn(volumes: ReadonlyMap<string, Volume>, id: string): string {
  const volume = volumes.get(id);
  return volume ? volumeName(volume) : 'a volume that was erased';
}

export function volumeKind(volume: Volume): string {
  const kind = volume.modality ?? formatNames[volume.format] ?? volume.format;
  return `${kind}, ${formatDims(volume.dims)}`;
}
