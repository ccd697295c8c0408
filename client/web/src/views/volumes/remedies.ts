// The options that a user can add to a rejected upload so that the server accepts it.
import { choicesOf, type ApiError } from '../../api/problem';
import type { Choice } from '../../api/types';
import { button, h } from '../../ui/dom';
import { peekAtSeries, type Peek } from '../../volume/dicom_peek';
import type { NamedFile } from '../../volume/tar';

// The values of the query's parameters that choose or accept something.
export type Choices = Readonly<Record<string, string>>;

// Repeats the upload and accepts the cause of its rejection, in addition to what was accepted before.
export function acceptButton(
  { remedy: { overridable } }: ApiError,
  before: Choices,
  onChoices: (choices: Choices) => void,
): HTMLButtonElement | false {
  if (overridable === undefined) return false;
  const accept = [before['accept'], overridable].filter(Boolean).join(',');
  return button('Accept it anyway', () => onChoices({ ...before, accept }));
}

const nouns = { series: 'series', member: 'file', volume: 'volume', spacing: 'distance between samples' } as const;

// The question that a rejected upload leaves open. '' if there is none, or if it was answered: then what the server says about
// the answer is to be seen.
export function questionOf(error: ApiError, before: Choices): string {
  const [first] = choicesOf(error).keys();
  return first === undefined || before[first] !== undefined ? '' : `Which ${nouns[first]}?`;
}

// Of a series, as far as the page can read its files.
function showPeek({ date, picture }: Peek, thumbnail: HTMLCanvasElement, facts: HTMLElement): void {
  facts.textContent = date;
  const context = picture && thumbnail.getContext('2d');
  if (!context) return;
  const { width, height, grey } = picture;
  [thumbnail.width, thumbnail.height] = [width, height];
  const image = context.createImageData(width, height);
  grey.forEach((value, i) => image.data.set([value, value, value, 255], 4 * i));
  context.putImageData(image, 0, 0);
}

function choiceList(
  parameter: Choice['parameter'],
  choices: readonly Choice[],
  files: readonly NamedFile[],
  onChoice: (value: string) => void,
): HTMLElement {
  const rows = choices.map(({ value, title }) => {
    const thumbnail = h('canvas', { width: 1, height: 1, 'aria-hidden': 'true', hidden: parameter !== 'series' });
    const facts = h('span', { class: 'faint' });
    const text = h('span', { class: 'choice-text' }, h('b', {}, title === '' ? `${nouns[parameter]} ${value}` : title), facts);
    return { value, thumbnail, facts, element: h('li', {}, button(h('span', { class: 'choice' }, thumbnail, text), () => onChoice(value))) };
  });
  if (parameter === 'series') {
    peekAtSeries(files.map(({ file }) => file), choices.map(({ value }) => value)).then(
      (found) => {
        for (const { value, thumbnail, facts } of rows) {
          const peek = found.get(value);
          if (peek) showPeek(peek, thumbnail, facts);
        }
      },
      // The browser cannot read the files any more. The titles are enough to choose.
      () => undefined,
    );
  }
  const own = parameter === 'spacing' && h('li', {}, spacingForm(onChoice));
  return h('ul', { class: 'choices', 'aria-label': `Which ${nouns[parameter]}?` }, ...rows.map(({ element }) => element), own);
}

// Other distances than those that the server offers.
function spacingForm(onChoice: (value: string) => void): HTMLElement {
  const input = h('input', { type: 'text', placeholder: '0.5,0.5,1', 'aria-label': 'Millimetres along x, y and z' });
  const form = h('form', { class: 'choice' }, input, h('button', { type: 'submit' }, 'Use these millimetres along x, y and z'));
  form.addEventListener('submit', (event) => {
    event.preventDefault();
    if (input.value.trim() !== '') onChoice(input.value.trim());
  });
  return form;
}

// A list for each parameter that the rejection leaves to be chosen.
export function choiceLists(
  error: ApiError,
  before: Choices,
  files: readonly NamedFile[],
  onChoices: (choices: Choices) => void,
): HTMLElement[] {
  return [...choicesOf(error)].map(([parameter, choices]) =>
    choiceList(parameter, choices, files, (value) => onChoices({ ...before, [parameter]: value })),
  );
}
