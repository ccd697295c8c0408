// The description of a volume beside its slices.
import { client } from '../../client';
import type { Volume } from '../../api/types';
import { button, h } from '../../ui/dom';
import { formatDims, volumeFormatTitle, formatSpacing, formatValue } from '../../ui/format';
import { askText, tellError } from '../../ui/notices';
import { go } from '../../ui/route';
import { areLabels, noteTexts, otherForm, skippedText, spanOf, volumeName } from '../../volume/names';
import { orientation } from './orientation';
import { uploads } from '../volumes/upload_panel';

// Lists the skipped files of an upload, because a user may miss them.
function ignoredNote(volume: Volume): HTMLElement | null {
  const { ignored } = volume;
  if (ignored.length === 0) return null;
  return h('details.more', [
    h('summary', skippedText([volume])),
    h('ul', ...ignored.map(({ name, reason }) => h('li', h('b', name), `: ${reason}`))),
  ]);
}

// Reads the file once more with that choice, and shows the progress where uploads are.
function againButton({ id }: Volume, text: string, choices: Readonly<Record<string, string>>): HTMLElement | false {
  return uploads.hasFileOf(id) && button(text, () => {
    uploads.readAgain(id, choices);
    go([]);
  });
}

// By the form that was not used.
function otherFormButton(volume: Volume, detail: string): HTMLElement | false {
  const form = otherForm(detail);
  return form !== null && againButton(volume, `Use the ${form}`, { nifti_form: form });
}

// Lists what the server decided or corrected when it read the upload.
function notesOf(volume: Volume): HTMLElement | null {
  const { notes } = volume;
  if (notes.length === 0) return null;
  const texts = noteTexts(volume);
  return h('ul.notes', { 'aria-label': 'Notes' }, [
    ...notes.map(({ code, detail }, place) =>
      h('li', { 'data-note': code }, texts[place], ' ', code === 'forms-differ' && otherFormButton(volume, detail)),
    ),
  ]);
}

// The volume's name, which a person can change.
function nameHeading(volume: Volume, onRenamed: () => void): HTMLElement {
  const text = h('span', volumeName(volume));
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
  return h('h1', text, ' ', button('Rename', () => void rename(), { class: 'quiet' }));
}

function factsOf(volume: Volume): string {
  return [
    volumeFormatTitle(volume.format),
    volume.modality,
    `${formatDims(volume.dims)}, ${volume.type}`,
    formatSpacing(volume.spacing),
    volume.stored_axes && `stored as ${volume.stored_axes}`,
    `values ${volume.range.map((value) => formatValue(value, spanOf(volume))).join(' to ')}`,
  ]
    .filter(Boolean)
    .join(' \u00b7 ');
}

// How to move in slices.
export function sliceHelp(): HTMLElement {
  return h('details.more.slice-help', [
    h('summary', 'How to use the slices'),
    h('ul', [
    h('li.by-mouse', h('b', 'Drag'), ' in a slice: change window and level'),
    h('li.by-touch', h('b', 'Drag sideways'), ' in a slice: change window and level; drag up or down: scroll the page'),
    h('li.by-mouse', h('b', 'Wheel'), ' or arrow keys: next or previous slice'),
    h('li.by-mouse', h('b', 'Ctrl and wheel'), ', or + and \u2212: zoom; ', h('b', 'Shift and drag'), ': move; 0: show the whole slice'),
    h('li.by-touch', h('b', 'Two fingers'), ': zoom and move'),
    h('li.by-mouse', h('b', 'Click'), ': move the other slices to this point'),
    h('li.by-mouse', h('b', 'Double click'), ' or i: use the value at this point as the iso-value; in a slab, the value in its middle slice'),
    h('li.by-mouse', h('b', 'Double click'), ' beside a slider, or the button there: show one view alone, or all'),
    h('li.by-touch', h('b', 'Slider'), ' below a slice: choose the slice'),
    h('li.by-touch', h('b', 'Tap'), ': move the other slices to this point'),
    h('li', h('b', 'Line in the histogram'), ': drag it to change the iso-value', h('span.by-mouse', '; the arrow keys move it too')),
    ]),
  ]);
}

// Its name and what it is.
export function aboutVolume(volume: Volume, onRenamed: () => void): HTMLElement {
  // Formats other than DICOM do not say it. Then skin, soft tissue and bone have iso-values with names.
  const ct = volume.modality === null && !areLabels(volume) && againButton(volume, 'This is a CT in Hounsfield units', { modality: 'ct' });
  return h('header.about', nameHeading(volume, onRenamed), h('p.facts', factsOf(volume)), ct);
}

// The notes and the skipped files of the upload, and how to correct its orientation.
export function notedOf(volume: Volume): (HTMLElement | null)[] {
  return [notesOf(volume), ignoredNote(volume), orientation(volume)];
}
