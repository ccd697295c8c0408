// Corrects a volume that its file places wrongly: flips it, or turns it by 90 degrees.
import { client } from '../../client';
import type { Volume } from '../../api/types';
import { button, h } from '../../ui/dom';
import { tell, tellError } from '../../ui/notices';
import { go } from '../../ui/route';
import { flipped, turned } from '../../volume/geometry';

export function orientation(volume: Volume): HTMLElement {
  const change = async (order: string): Promise<void> => {
    try {
      go(['volumes', (await client.reorientVolume(volume.id, order)).id]);
      tell('This is a copy with another orientation. The volume that it was made from stays in the list.');
    } catch (error) {
      tellError(error);
    }
  };
  const choice = (verb: string, text: string, order: string): HTMLElement => button(text, () => void change(order), { class: 'chip', 'aria-label': `${verb} ${text}` });
  return h('details.more', [
    h('summary', 'Is the volume placed wrongly?'),
    h('p.hint', 'Its file may exchange sides. A corrected copy is stored beside it, with a note.'),
    h('p.presets', 'Flip: ', ...['left and right', 'front and back', 'head and feet'].map((text, axis) => choice('Flip', text, flipped(volume, axis as 0)))),
    h('p.presets', 'Turn clockwise by 90\u00b0 in: ', ...(['axial', 'coronal', 'sagittal'] as const).map((plane) => choice('Turn in', `${plane} slices`, turned(volume, plane)))),
  ]);
}
