// The options that a user can add to a rejected upload so that the server accepts it.
import { choicesOf, type ApiError } from '../../api/problem';
import type { Choice } from '../../api/types';
import { button, field, h } from '../../ui/dom';

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
