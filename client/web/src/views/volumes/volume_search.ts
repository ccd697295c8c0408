// Finds volumes by what they are called, and sorts them.
import type { Volume } from '../../api/types';
import { h, select } from '../../ui/dom';
import { volumeKind, volumeName } from '../../volume/names';

const orders: Record<string, { title: string; compare: ((a: Volume, b: Volume) => number) | null }> = {
  newest: { title: 'newest first', compare: null },
  name: { title: 'by name', compare: (a, b) => volumeName(a).localeCompare(volumeName(b), undefined, { numeric: true }) },
  size: { title: 'largest first', compare: (a, b) => b.bytes - a.bytes },
};

// The volumes whose name, kind or patient contains all words, sorted by `order` of the table above.
export function foundVolumes(volumes: readonly Volume[], text: string, order: string): Volume[] {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const found = volumes.filter((volume) => {
    const told = `${volumeName(volume)} ${volumeKind(volume)} ${volume.dicom?.patient_id ?? ''}`.toLowerCase();
    return words.every((word) => told.includes(word));
  });
  const compare = orders[order]?.compare;
  return compare ? found.sort(compare) : found;
}

export class VolumeSearch {
  readonly element: HTMLElement;
  private readonly input = h('input', { type: 'search', placeholder: 'Search', 'aria-label': 'Search volumes' });
  private readonly order: HTMLSelectElement;

  constructor(onChange: () => void) {
    const titles = Object.entries(orders).map(([value, { title }]) => [value, title] as const);
    this.order = select(titles, 'newest', onChange, { 'aria-label': 'Sort volumes' });
    this.element = h('div.volume-search', { role: 'search' }, this.input, this.order);
    this.input.addEventListener('input', onChange);
  }

  // True if all volumes have to be loaded.
  get isOn(): boolean {
    return this.input.value.trim() !== '' || this.order.value !== 'newest';
  }

  found(volumes: readonly Volume[]): Volume[] {
    return foundVolumes(volumes, this.input.value, this.order.value);
  }
}
