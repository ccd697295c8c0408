// Volumes by their ids, each asked for once: to call those by their names that jobs were made of.
import { client } from '../client';
import { isGone } from '../api/problem';
import type { Volume } from '../api/types';
import { volumeName } from './names';

export class KnownVolumes {
  // Null: it was erased.
  private readonly known = new Map<string, Volume | null>();

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
          if (!isGone(error)) throw error;
          this.known.set(id, null);
        }
      }),
    );
  }

  // Null: it was erased, or was not asked for.
  get(id: string): Volume | null {
    return this.known.get(id) ?? null;
  }

  // A volume of a list, with the patient if it was asked for.
  detailed(volume: Volume): Volume {
    return { ...volume, dicom: this.known.get(volume.id)?.dicom };
  }

  nameOf(id: string): string {
    const volume = this.known.get(id);
    if (volume === undefined) return '';
    return volume ? volumeName(volume) : 'erased volume';
  }
}
