// Iso-values to choose by name: Otsu's, those of the volume, and a person's own, which this browser keeps for volumes of that modality.
import type { Volume } from '../../api/types';
import { button, h } from '../../ui/dom';
import { formatValue, shortened } from '../../ui/format';
import { askText, tell } from '../../ui/notices';
import { spanOf } from '../../volume/names';

interface Named {
  name: string;
  iso: number;
}

const key = 'isomesh.presets';
const mostOwn = 12;

// By modality; '' for volumes of none. Empty if what is kept is no such table.
function kept(): Partial<Record<string, Named[]>> {
  try {
    return (JSON.parse(localStorage.getItem(key) ?? '{}') ?? {}) as Record<string, Named[]>;
  } catch {
    return {};
  }
}

export function isoPresets(volume: Volume, iso: () => number, onIso: (iso: number) => void): HTMLElement {
  const { modality, presets, suggested_iso: otsu } = volume;
  const span = spanOf(volume);
  const element = h('div.presets', { role: 'group', 'aria-label': 'Presets' });
  const chip = ({ name, iso: value }: Named): HTMLElement =>
    button(`${name} ${formatValue(value, span)}`, () => onIso(shortened(value, span)), { class: 'chip' });
  const keep = (own: Named[]): void => {
    localStorage.setItem(key, JSON.stringify({ ...kept(), [modality ?? '']: own }));
    show();
  };
  const add = async (): Promise<void> => {
    const own = kept()[modality ?? ''] ?? [];
    if (own.length >= mostOwn) return tell(`Remove one of your ${mostOwn} presets first.`);
    const value = iso();
    const name = await askText(`Name for the iso-value ${formatValue(value, span)}`, '', 'Save');
    if (name) keep([...own.filter((one) => one.name !== name), { name, iso: value }]);
  };
  const show = (): void => {
    const own = kept()[modality ?? ''] ?? [];
    element.replaceChildren(
      ...[{ name: 'Otsu', iso: otsu }, ...presets].map(chip),
      ...own.map((one) =>
        h('span.own', chip(one), button('\u00d7', () => keep(own.filter((other) => other !== one)), { class: 'chip', 'aria-label': `Remove the preset ${one.name}` })),
      ),
      button('Save as preset', () => void add(), { class: 'chip', title: 'Keeps this iso-value under a name in this browser' }),
    );
  };
  show();
  return element;
}
