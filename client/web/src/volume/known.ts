// Volumes by their ids, each asked for once: to call those by their names that jobs were made of.
import { client } from '../client';
import { asApiError, isGone } from '../api/problem';
import type { Volume } from '../api/types';
import { volumeName } from './names';

// Why there is no volume although a job was made of it.
export type Missing = 'erased' | 'unreadable';

// One damaged volume takes neither the list of volumes nor that of jobs away. Null: what failed was the request.
function whyMissing(error: unknown): Missing | null {
  if (isGone(error)) return 'erased';
  return [422, 500].includes(asApiError(error).status) ? 'unreadable' : null;
}

export class KnownVolumes {
  private readonly known = new Map<string, Volume | Missing>();

  learn(volumes: readonly Volume[]): void {
    for (const volume of volumes) this.known.set(volume.id, volume);
  }

  // Asks for the first `most` of those that are unknown. Throws when nobody answers; what was learnt until then stays.
  async find(ids: Iterable<string>, most = Infinity): Promise<void> {
    const unknown = [...new Set(ids)].filter((id) => !this.known.has(id)).slice(0, most);
    await Promise.all(
      unknown.map(async (id) => {
        try {
          this.known.set(id, await client.getVolume(id));
        } catch (error) {
          const missing = whyMissing(error);
          if (missing === null) throw error;
          this.known.set(id, missing);
        }
      }),
    );
  }

  // Null: it is missing, or was not asked for.
  get(id: string): Volume | null {
    const found = this.known.get(id);
    return typeof found === 'object' ? found : null;
  }

  // A volume of a list, with the patient if it was asked for.
  detailed(volume: Volume): Volume {
    return { ...volume, dicom: this.get(volume.id)?.dicom };
  }

  // '' for one that was not asked for.
  nameOf(id: string): string {
    const found = this.known.get(id);
    if (found === undefined) return '';
    return typeof found === 'object' ? volumeName(found) : `${found} volume`;
  }
}
