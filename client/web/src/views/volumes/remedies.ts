// The options that a user can add to a rejected upload so that the server accepts it.
import { choicesOf, type ApiError } from '../../api/problem';
import type { Choice } from '../../api/types';
import { button, h, uniqueId } from '../../ui/dom';
import { hashOf } from '../../ui/route';
import { numbersOf } from '../../ui/numbers';
import { dateOf } from '../../volume/names';
import type { Gathered } from '../../volume/gather';
import { paintPicture, timeChoice } from './time_choice';

// The values of the query's parameters that choose or accept something.
export type Choices = Readonly<Record<string, string>>;

// A rejection that asks, and the choices with which the upload was sent.
export interface Asked {
  error: ApiError;
  choices: Choices;
}

// Still to be answered after this rejection of the last answer: its own question, or else the one of before.
export function openQuestion(error: ApiError, choices: Choices, before: Asked | null): Asked | null {
  return choicesOf(error).size > 0 ? { error, choices } : before;
}

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

// The UIDs of the series that a question offers.
export function seriesOf(asked: Asked | null): string[] {
  return ((asked && choicesOf(asked.error).get('series')) ?? []).map(({ value }) => value);
}

// Those that are not read yet.
export function unread(asked: Asked | null, stored: Stored): string[] {
  return seriesOf(asked).filter((uid) => !stored.has(uid));
}

// The series of an upload that were read, by their UIDs.
type Stored = Gathered['stored'];

interface Row {
  choice: Choice;
  element: HTMLElement;
}

// As the server tells it of DICOM files.
function studyOf({ series }: Choice): { patient: string; study: string; date: string } {
  const date = dateOf(series?.study_date);
  return {
    patient: [series?.patient_name.replace(/\^+/g, ' ').trim(), series?.patient_id].filter(Boolean).join(', '),
    study: [series?.study_description, date].filter(Boolean).join(', '),
    date,
  };
}

// Each with its own members, in the order in which they come first.
function grouped<T>(all: readonly T[], key: (one: T) => string): [string, T[]][] {
  const groups = new Map<string, T[]>();
  for (const one of all) groups.set(key(one), [...(groups.get(key(one)) ?? []), one]);
  return [...groups];
}

// By patient, date of the study and title. The server tells no series' number unless titles are equal, which then end with it.
export function sortedSeries(choices: readonly Choice[]): Choice[] {
  const compare = (a: string, b: string): number => a.localeCompare(b, undefined, { numeric: true });
  return choices
    .map((choice) => ({ choice, ...studyOf(choice) }))
    .sort((a, b) => compare(a.patient, b.patient) || compare(a.date, b.date) || compare(a.choice.title, b.choice.title))
    .map(({ choice }) => choice);
}

// Patients, their studies and the series of these.
function tree(rows: readonly Row[]): HTMLElement[] {
  return grouped(rows, ({ choice }) => studyOf(choice).patient).map(([patient, own]) =>
    h('li.choice-group', [
      h('b', patient || 'Other patients'),
      ...grouped(own, ({ choice }) => choice.series?.study_uid ?? '').map(([, [first, ...others]]) =>
        h('div.choice-study', h('span.faint', (first && studyOf(first.choice).study) || 'Study'), h('ul', ...[first, ...others].map((row) => row?.element))),
      ),
    ]),
  );
}

function choiceList(
  parameter: Choice['parameter'],
  choices: readonly Choice[],
  stored: Stored,
  answered: string,
  onChoice: (...values: [string, ...string[]]) => void,
): HTMLElement {
  const marked = new Set<string>();
  const readMarked = button('', () => onChoice(...([...marked] as [string])), { class: 'primary', hidden: true });
  const mark = (value: string, isOn: boolean): void => {
    if (isOn) marked.add(value);
    else marked.delete(value);
    readMarked.hidden = marked.size === 0;
    readMarked.textContent = `Read the ${marked.size} marked`;
  };
  // A single study needs no heading.
  const isByStudy = new Set(choices.map(({ series }) => series?.study_uid)).size > 1;
  const rows = (parameter === 'series' ? sortedSeries(choices) : choices).map((choice): Row => {
    const { value, title } = choice;
    const picture = choice.series && choice.picture;
    const thumbnail = picture && h('canvas', { 'aria-hidden': 'true' });
    if (thumbnail) paintPicture(picture, thumbnail);
    const text = h('span.choice-text', h('b', title === '' ? `${nouns[parameter]} ${value}` : title), !isByStudy && h('span.faint', studyOf(choice).date));
    const seen = h('span.choice', thumbnail, text);
    const volume = stored.get(value);
    const isOneOfSeveral = parameter === 'series' && !volume && choices.length > 1;
    const box = isOneOfSeveral && h('input', { type: 'checkbox', 'aria-label': `Mark ${title}` });
    if (box) box.addEventListener('change', () => mark(value, box.checked));
    const element = volume ? h('li.stored', h('a', { href: hashOf(['volumes', volume.id]) }, seen), h('span.faint', 'stored')) : h('li', box, button(seen, () => onChoice(value)));
    return { choice, element };
  });
  const own = parameter === 'spacing' && h('li', spacingForm(choices.some(({ value }) => value === answered) ? '' : answered, onChoice));
  const list = h('ul.choices', { 'aria-label': `Which ${nouns[parameter]}?` }, ...(isByStudy ? tree(rows) : rows.map(({ element }) => element)), own, h('li', readMarked));
  return parameter === 'volume' && choices.every(({ picture }) => picture) ? h('div.stack', timeChoice(choices, onChoice), list) : list;
}

// For the server, or why they cannot be sent.
export function spacingOf(text: string): { value: string; fault: '' } | { value: null; fault: string } {
  const lengths = numbersOf(text);
  if (lengths.length !== 3 || lengths.some(Number.isNaN)) {
    return { value: null, fault: 'Enter three numbers, such as 0.5 0.5 1.' };
  }
  if (lengths.some((length) => length <= 0)) return { value: null, fault: 'The distances must be positive.' };
  return { value: lengths.join(','), fault: '' };
}

// Other distances than those that the server offers.
function spacingForm(answered: string, onChoice: (value: string) => void): HTMLElement {
  const fault = h('p.fault', { id: uniqueId('fault'), role: 'alert', hidden: true });
  const input = h('input', {
    type: 'text',
    value: answered,
    placeholder: '0.5 0.5 1',
    autocomplete: 'off',
    'aria-label': 'Millimetres along x, y and z',
    'aria-errormessage': fault.id,
  });
  const mark = (text: string): void => {
    input.setAttribute('aria-invalid', String(text !== ''));
    fault.textContent = text;
    fault.hidden = text === '';
  };
  input.addEventListener('input', () => mark(''));
  const form = h('form.choice', input, h('button', { type: 'submit' }, 'Use these millimetres along x, y and z'), fault);
  form.addEventListener('submit', (event) => {
    event.preventDefault();
    const spacing = spacingOf(input.value);
    mark(spacing.fault);
    if (spacing.value === null) input.focus();
    else onChoice(spacing.value);
  });
  return form;
}

// A list for each parameter that the rejection leaves to be chosen. `now` are the choices of the last attempt. Several series
// may be chosen at once.
export function choiceLists(
  asked: Asked | null,
  now: Choices,
  stored: Stored,
  onChoices: (...each: [Choices, ...Choices[]]) => void,
): HTMLElement[] {
  if (!asked) return [];
  return [...choicesOf(asked.error)].map(([parameter, choices]) =>
    choiceList(parameter, choices, stored, now[parameter] ?? '', (...values) => {
      const [first, ...others] = values.map((value) => ({ ...asked.choices, [parameter]: value }));
      if (first) onChoices(first, ...others);
    }),
  );
}
