// What there is to say about a volume beside its slices.
import { client } from '../client';
import type { Volume } from '../api/types';
import { button, h } from '../ui/dom';
import { formatDims, formatNames, formatSpacing, formatValue } from '../ui/format';
import { askText, tellError } from '../ui/notices';
import { volumeName } from '../volume/names';

// What of an upload was left out, because a person may miss it.
function ignoredNote({ ignored }: Volume): HTMLElement | null {
  if (ignored.length === 0) return null;
  return h(
    'details',
    { class: 'more' },
    h('summary', {}, ignored.length === 1 ? '1 file was left out' : `${ignored.length} files were left out`),
    h('ul', {}, ...ignored.map(({ name, reason }) => h('li', {}, h('b', {}, name), `: ${reason}`))),
  );
}

// What the server decided or corrected when it read the upload.
function notesOf({ notes }: Volume): HTMLElement | null {
  if (notes.length === 0) return null;
  return h(
    'ul',
    { class: 'notes', 'aria-label': 'Notes' },
    ...notes.map(({ code, detail }) => h('li', { 'data-note': code }, detail)),
  );
}

// The volume's name, which a person can change.
function nameHeading(volume: Volume, onRenamed: () => void): HTMLElement {
  const text = h('span', {}, volumeName(volume));
  const rename = async (): Promise<void> => {
    const name = await askText('Name of this volume', volume.name ?? '', 'Rename');
    if (name === null) return;
    try {
      volume.name = (await client.renameVolume(volume.id, name === '' ? null : name)).name;
      text.textContent = volumeName(volume);
      onRenamed();
    } catch (error) {
      tellError(error);
    }
  };
  return h('h1', {}, text, ' ', button('Rename', () => void rename(), { class: 'quiet' }));
}

function factsOf(volume: Volume): string {
  return [
    formatNames[volume.format] ?? volume.format,
    volume.modality,
    `${formatDims(volume.dims)}, ${volume.type}`,
    formatSpacing(volume.spacing),
    `values ${formatValue(volume.range[0])} to ${formatValue(volume.range[1])}`,
  ]
    .filter(Boolean)
    .join(' \u00b7 ');
}

// How to move in slices.
export function sliceHelp(): HTMLElement {
  return h(
    'details',
    { class: 'more slice-help' },
    h('summary', {}, 'How to move in the slices'),
    h(
      'ul',
      {},
    h('li', { class: 'by-mouse' }, h('b', {}, 'Drag'), ' in a slice: window and level'),
    h('li', { class: 'by-touch' }, h('b', {}, 'Drag to the side'), ' in a slice: window and level; up and down scrolls'),
    h('li', { class: 'by-mouse' }, h('b', {}, 'Wheel'), ' or arrow keys: next slice'),
    h('li', { class: 'by-mouse' }, h('b', {}, 'Ctrl and wheel'), ', or + and \u2212: zoom; ', h('b', {}, 'Shift and drag'), ': move; 0: all of it'),
    h('li', { class: 'by-touch' }, h('b', {}, 'Two fingers'), ': zoom and move'),
    h('li', { class: 'by-mouse' }, h('b', {}, 'Click'), ': the other slices go there'),
    h('li', { class: 'by-mouse' }, h('b', {}, 'Double click'), ' or i: the value there becomes the iso-value'),
    h('li', { class: 'by-touch' }, h('b', {}, 'Slider'), ' below it: next slice'),
    h('li', { class: 'by-touch' }, h('b', {}, 'Tap'), ': the other slices go there'),
    h('li', {}, h('b', {}, 'Line in the histogram'), ': the iso-value', h('span', { class: 'by-mouse' }, '; arrow keys move it too')),
    ),
  );
}

// Its name and what it is.
export function aboutVolume(volume: Volume, onRenamed: () => void): HTMLElement {
  return h('header', { class: 'about' }, nameHeading(volume, onRenamed), h('p', { class: 'facts' }, factsOf(volume)));
}

// What was noted when it was read.
export function notedOf(volume: Volume): (HTMLElement | null)[] {
  return [notesOf(volume), ignoredNote(volume)];
}
