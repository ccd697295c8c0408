// The parameters of a job beside its iso-value, one control for each row of their table.
import type { JobParameters, MeshFormat } from '../api/types';
import { withGlb } from '../job/parameters';
import {
  applies,
  asText,
  defaultOf,
  fits,
  isOfKind,
  maximumOf,
  meshFormats,
  parameterOf,
  parameters,
  valueIn,
  type Parameter,
  type Value,
} from '../job/table';
import { checkbox, field, h, segmented } from '../ui/dom';
import { formatNames, formatValue } from '../ui/format';

export interface FormHost {
  job: () => JobParameters;
  set: (parameter: Parameter, value: Value) => void;
}

interface Control {
  element: HTMLElement;
  // Shows the job's present value.
  update?: () => void;
}

// These are chosen elsewhere: the volume before, the iso-value in the histogram, labels in their list;
// what labels are called and are made of is the volume's.
const elsewhere = ['volume', 'iso', 'labels', 'background', 'label_names', 'label_colors', 'label_values'];
// Those that are seen at once, in rows. All others are under "More".
const front = [['scheme', 'interpolation'], ['smoothing', 'passes'], ['priority']];

export const shown = parameters.filter(({ name }) => !elsewhere.includes(name));

function isNumber({ kind }: Parameter): boolean {
  return kind === 'number' || kind === 'integer';
}

function labelOf({ title, unit }: Parameter): string {
  return unit === '' ? title : `${title}, in ${unit}`;
}

function capitalised(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function choiceControl(parameter: Parameter, host: FormHost): Control {
  const { values = [], valueHelp } = parameter;
  const choices = values.map((value) => ({
    value: String(value),
    label: capitalised(String(value)),
    title: valueHelp?.[String(value)],
  }));
  const value = asText(valueIn(host.job(), parameter));
  const set = (text: string): void =>
    host.set(parameter, values.find((known) => String(known) === text) ?? text);
  return { element: segmented(labelOf(parameter), choices, value, set) };
}

function switchControl(parameter: Parameter, host: FormHost): Control {
  const isOn = valueIn(host.job(), parameter) === true;
  return { element: checkbox(labelOf(parameter), isOn, (value) => host.set(parameter, value)) };
}

// The step of the arrows beside a number; other values may be typed.
function stepOf({ kind, maximum }: Parameter): number | 'any' {
  if (kind === 'integer') return 1;
  return maximum === undefined ? 'any' : 10 ** Math.floor(Math.log10(maximum)) / 100;
}

// What stands in an empty field: what the daemon takes then.
function placeholderOf(parameter: Parameter, job: JobParameters): string {
  if (!applies(parameter, job)) return `${Object.keys(parameter.by?.cases ?? {}).map(capitalised).join(', ')} only`;
  const standard = defaultOf(parameter, job) ?? null;
  return typeof standard === 'number' ? formatValue(standard) : 'no limit';
}

function numberControl(parameter: Parameter, host: FormHost): Control {
  const input = h('input', {
    type: 'number',
    inputmode: 'decimal',
    step: stepOf(parameter),
    min: parameter.minimum ?? parameter.above,
  });
  const mark = (isGood: boolean): void => input.setAttribute('aria-invalid', String(!isGood));
  const update = (): void => {
    const job = host.job();
    const isUsed = applies(parameter, job);
    input.disabled = !isUsed;
    input.max = String(maximumOf(parameter, job) ?? '');
    input.placeholder = placeholderOf(parameter, job);
    input.value = isUsed ? asText(valueIn(job, parameter)) : '';
    mark(true);
  };
  input.addEventListener('input', () => {
    // The value is also empty when what was typed is no number; then badInput is true.
    const value = input.value === '' && !input.validity.badInput ? null : input.valueAsNumber;
    const isGood = fits(parameter, value, host.job());
    mark(isGood);
    if (isGood) host.set(parameter, value);
  });
  update();
  return { element: field(labelOf(parameter), input), update };
}

function formatsControl(parameter: Parameter, host: FormHost): Control {
  const chosen = new Set<MeshFormat>(host.job().formats);
  const box = (format: MeshFormat): HTMLElement =>
    checkbox(
      formatNames[format] ?? format,
      chosen.has(format),
      (isOn) => {
        if (isOn) chosen.add(format);
        else chosen.delete(format);
        host.set(parameter, withGlb([...chosen]));
      },
      // The page shows this one.
      format === 'glb' ? { disabled: true } : {},
    );
  const element = h('fieldset', { class: 'boxes' }, h('legend', {}, labelOf(parameter)), ...meshFormats.map(box));
  return { element };
}

function controlFor(parameter: Parameter, host: FormHost): Control {
  switch (parameter.kind) {
    case 'number':
    case 'integer':
      return numberControl(parameter, host);
    case 'switch':
      return switchControl(parameter, host);
    case 'choice':
      return choiceControl(parameter, host);
    case 'choices':
      if (parameter.name === 'formats') return formatsControl(parameter, host);
  }
  throw new Error(`${parameter.name}: the page has no control for it`);
}

// For a job at an iso-value, or for one by labels, as the present one is.
export function parameterForm(host: FormHost): HTMLElement {
  const dependents: { on: string; update: () => void }[] = [];
  const watching: FormHost = {
    job: host.job,
    set: (parameter, value) => {
      host.set(parameter, value);
      for (const { on, update } of dependents) if (on === parameter.name) update();
    },
  };
  const elementFor = (parameter: Parameter): HTMLElement => {
    const { element, update } = controlFor(parameter, watching);
    if (parameter.by && update) dependents.push({ on: parameter.by.parameter, update });
    element.dataset.parameter = parameter.name;
    element.title = parameter.help;
    return element;
  };
  const offered = shown.filter((parameter) => isOfKind(parameter, host.job()));
  const rows = front.map((names) =>
    h('div', { class: 'row' }, ...names.map(parameterOf).filter((one) => offered.includes(one)).map(elementFor)),
  );
  const others = offered.filter(({ name }) => !front.flat().includes(name));
  return h(
    'div',
    { class: 'parameters' },
    ...rows,
    h(
      'details',
      { class: 'more' },
      h('summary', {}, 'More'),
      h('div', { class: 'pair' }, ...others.filter(isNumber).map(elementFor)),
      ...others.filter((parameter) => !isNumber(parameter)).map(elementFor),
    ),
  );
}
