// What a person calls a volume.
import type { Volume } from '../api/types';
import { formatDims, formatNames } from '../ui/format';

// A date of DICOM, 20240501, for people.
function dateOf(text: string | undefined): string {
  const match = /^(\d{4})(\d{2})(\d{2})$/.exec(text ?? '');
  return match ? `${match[1]}-${match[2]}-${match[3]}` : '';
}

// Whose and which study it is, and what it is called; or else what it holds.
export function volumeName(volume: Volume): string {
  const { patient_name: patient, series_description: series, study_date: date } = volume.dicom ?? {};
  const own = (volume.name ?? series)?.trim();
  const told = [patient?.replaceAll('^', ' ').trim(), own, dateOf(date)].filter(Boolean);
  return told.length > 0 ? told.join(', ') : volumeKind(volume);
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
