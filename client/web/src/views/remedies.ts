// What a person may add to an upload that was refused, so that it is taken.
import { choicesOf, type ApiError } from '../api/problem';
import type { Choice } from '../api/types';
import { button, field, h } from '../ui/dom';

// What chooses and accepts, by its parameter of the query.
export type Choices = Readonly<Record<string, string>>;

// Has the upload taken in spite of what it was refused for, beside what was accepted before.
export function acceptButton(
  { remedy: { overridable } }: ApiError,
  before: Choices,
  onChoices: (choices: Choices) => void,
): HTMLButtonElement | false {
  if (overridable === undefined) return false;
  const accept = [before['accept'], overridable].filter(Boolean).join(',');
  return button('Accept it anyway', () => onChoices({ ...before, accept }));
}

function choiceForm(
  parameter: Choice['parameter'],
  choices: Choice[],
  onChoice: (value: string) => void,
): HTMLElement {
  const noun = { series: 'series', member: 'file', volume: 'volume' }[parameter];
  const select = h(
    'select',
    {},
    ...choices.map(({ value, title }) => h('option', { value }, title === '' ? value : `${title} (${value})`)),
  );
  return h(
    'div',
    { class: 'series' },
    field(`${noun.charAt(0).toUpperCase()}${noun.slice(1)} to read`, select),
    button(`Use this ${noun}`, () => onChoice(select.value), { class: 'primary' }),
  );
}

// A form for each parameter that the refusal leaves to be chosen.
export function choiceForms(
  error: ApiError,
  before: Choices,
  onChoices: (choices: Choices) => void,
): HTMLElement[] {
  return [...choicesOf(error)].map(([parameter, choices]) =>
    choiceForm(parameter, choices, (value) => onChoices({ ...before, [parameter]: value })),
  );
}
