// The parameters of a job beside its iso-value, one control for each row of their table.
import type { JobParameters, MeshFormat } from '../../api/types';
import { fromText, isShownCodec, shownFiles, withGlb } from '../../job/parameters';
import {
  applies,
  asText,
  choicesOf,
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
} from '../../job/table';
import { checkbox, field, h, segmented } from '../../ui/dom';
import { formatValue, meshFormatTitle } from '../../ui/format';
import { NumberField } from '../../ui/number_field';
import { errorSlider, type SliderHost } from './error_slider';

export interface FormHost {
  job: () => JobParameters;
  set: (parameter: Parameter, value: Value) => void;
  // Says if the value in the parameter's control is valid. While it is not, the job keeps its previous value.
  mark: (parameter: Parameter, isGood: boolean) => void;
  slider: SliderHost;
  // Has a control beside the form.
  hides: readonly string[];
}

interface Control {
  element: HTMLElement;
  // Shows the job's present value; called when one of these has changed.
  update?: () => void;
  follows?: readonly string[];
}

// These are chosen elsewhere: the volume before, the iso-value in the histogram, labels in their list.
// Names, colours and values of labels come from the volume.
const elsewhere = ['volume', 'iso', 'labels', 'background', 'label_names', 'label_colors', 'label_values'];
// The parameters that are always visible, in rows. All others are under "More", these first.
const front = [['inside'], ['max_error_mm'], ['triangles', 'certify'], ['fill_cavities']];
const behind = [['scheme', 'interpolation'], ['regularize'], ['smoothing'], ['passes', 'lambda'], ['priority']];

export const shown = parameters.filter(({ name }) => !elsewhere.includes(name));

function isNumber({ kind }: Parameter): boolean {
  return kind === 'number' || kind === 'integer';
}

function labelOf({ title, unit }: Parameter): string {
  return unit === '' ? title : `${title}, in ${unit}`;
}

const abbreviations = ['bcc', 'fcc', 'lps', 'ras'];

function capitalised(text: string): string {
  return abbreviations.includes(text) ? text.toUpperCase() : text.charAt(0).toUpperCase() + text.slice(1);
}

function choiceControl(parameter: Parameter, host: FormHost): Control {
  const { valueHelp } = parameter;
  const values = choicesOf(parameter, host.job());
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

// Says so if the page cannot show the file.
function codecControl(parameter: Parameter, host: FormHost): Control {
  const hint = h('p.hint', { role: 'status' });
  const update = (): void => {
    const codec = valueIn(host.job(), parameter) ?? 'draco';
    hint.textContent = isShownCodec(codec) ? '' : `The page cannot show GLB with the codec ${asText(codec)}. It shows ${shownFiles}.`;
  };
  update();
  return { element: h('div', choiceControl(parameter, host).element, hint), update, follows: [parameter.name] };
}

function switchControl(parameter: Parameter, host: FormHost): Control {
  const isOn = valueIn(host.job(), parameter) === true;
  return { element: checkbox(labelOf(parameter), isOn, (value) => host.set(parameter, value)) };
}

// A bound for the error, or for the triangles, has it measured in any case.
function certifyControl(parameter: Parameter, host: FormHost): Control {
  const element = checkbox(labelOf(parameter), false, (value) => host.set(parameter, value));
  const [input] = element.getElementsByTagName('input');
  const update = (): void => {
    const job = host.job();
    const isImplied = (job.max_error_mm ?? job.triangles ?? null) !== null;
    if (!input) return;
    input.checked = isImplied || job.certify === true;
    input.disabled = isImplied;
  };
  update();
  return { element, update, follows: ['max_error_mm', 'triangles'] };
}

function errorControl(parameter: Parameter, host: FormHost): Control {
  const value = host.job().max_error_mm ?? null;
  return { element: errorSlider(parameter.title, value, host.slider, (error) => host.set(parameter, error)) };
}

// The step of the arrows beside a number; other values may be typed.
function stepOf({ kind, maximum }: Parameter): number {
  return kind === 'integer' || maximum === undefined ? 1 : 10 ** Math.floor(Math.log10(maximum)) / 100;
}

// The placeholder of an empty field: the value that the daemon uses then.
function placeholderOf(parameter: Parameter, job: JobParameters): string {
  if (!applies(parameter, job)) return `${Object.keys(parameter.by?.cases ?? {}).map(capitalised).join(', ')} only`;
  const standard = defaultOf(parameter, job) ?? null;
  return typeof standard === 'number' ? formatValue(standard) : 'no limit';
}

// The error message of a number that is not valid.
function faultOf(parameter: Parameter, job: JobParameters): string {
  const { kind, minimum, above } = parameter;
  const most = maximumOf(parameter, job);
  const limits = [
    minimum === undefined ? '' : `at least ${minimum}`,
    above === undefined ? '' : `more than ${above}`,
    most === undefined ? '' : `at most ${most}`,
  ].filter(Boolean);
  const noun = kind === 'integer' ? 'a whole number' : 'a number';
  return `Enter ${[noun, limits.join(' and ')].filter(Boolean).join(', ')}${parameter.isNullable ? ', or leave this empty' : ''}.`;
}

function numberControl(parameter: Parameter, host: FormHost): Control {
  const number = new NumberField({ step: stepOf(parameter), min: parameter.minimum ?? parameter.above });
  const { input } = number;
  const update = (): void => {
    const job = host.job();
    const isUsed = applies(parameter, job);
    const value = valueIn(job, parameter);
    input.disabled = !isUsed;
    number.limit({ max: maximumOf(parameter, job) });
    input.placeholder = placeholderOf(parameter, job);
    number.write(isUsed && typeof value === 'number' ? value : null);
    host.mark(parameter, true);
  };
  input.addEventListener('input', () => {
    const { value } = number;
    const isGood = fits(parameter, value, host.job());
    number.mark(isGood ? '' : number.textFault || faultOf(parameter, host.job()));
    host.mark(parameter, isGood);
    if (isGood) host.set(parameter, value);
  });
  update();
  const element = field(labelOf(parameter), input);
  element.append(number.fault);
  return { element, update };
}

// Numbers with commas between them.
function listControl(parameter: Parameter, host: FormHost): Control {
  const input = h('input', { type: 'text', inputmode: 'text', placeholder: 'none', autocomplete: 'off' });
  input.value = asText(valueIn(host.job(), parameter));
  input.addEventListener('input', () => {
    const text = input.value.replaceAll(/\s/g, '');
    const value = text === '' ? null : fromText(parameter, text);
    const isGood = value === null || fits(parameter, value, host.job());
    input.setAttribute('aria-invalid', String(!isGood));
    if (isGood) host.set(parameter, value);
  });
  return { element: field(labelOf(parameter), input) };
}

function formatsControl(parameter: Parameter, host: FormHost): Control {
  const chosen = new Set<MeshFormat>(host.job().formats);
  const box = (format: MeshFormat): HTMLElement =>
    checkbox(
      meshFormatTitle(format),
      chosen.has(format),
      (isOn) => {
        if (isOn) chosen.add(format);
        else chosen.delete(format);
        host.set(parameter, withGlb([...chosen]));
      },
      // The page shows this one.
      format === 'glb' ? { disabled: true } : {},
    );
  const element = h('fieldset.boxes', h('legend', labelOf(parameter)), ...meshFormats.map(box));
  return { element };
}

// By names, else by kinds.
const controls: Partial<Record<string, (parameter: Parameter, host: FormHost) => Control>> = {
  max_error_mm: errorControl,
  certify: certifyControl,
  formats: formatsControl,
  glb_codec: codecControl,
  number: numberControl,
  integer: numberControl,
  switch: switchControl,
  choice: choiceControl,
  numbers: listControl,
  places: listControl,
};

function controlFor(parameter: Parameter, host: FormHost): Control {
  const make = controls[parameter.name] ?? controls[parameter.kind];
  if (!make) throw new Error(`${parameter.name}: the page has no control for it`);
  return make(parameter, host);
}

// For a job at an iso-value, or for one by labels, as the present one is. With `isOpen` all of it is shown.
export function parameterForm(host: FormHost, isOpen: boolean): HTMLElement {
  const dependents: { on: readonly string[]; update: () => void }[] = [];
  const watching: FormHost = {
    ...host,
    set: (parameter, value) => {
      host.set(parameter, value);
      for (const { on, update } of dependents) if (on.includes(parameter.name)) update();
    },
  };
  const elementFor = (parameter: Parameter): HTMLElement => {
    const { element, update, follows = [] } = controlFor(parameter, watching);
    const on = parameter.by ? [...follows, parameter.by.parameter] : follows;
    if (update) dependents.push({ on, update });
    element.dataset.parameter = parameter.name;
    element.title = parameter.help;
    return element;
  };
  const offered = shown.filter((parameter) => isOfKind(parameter, host.job()) && !host.hides.includes(parameter.name));
  const rowsOf = (rows: readonly (readonly string[])[]): HTMLElement[] =>
    rows.map((names) => h('div.row', ...names.map(parameterOf).filter((one) => offered.includes(one)).map(elementFor)));
  const others = offered.filter(({ name }) => ![...front, ...behind].flat().includes(name));
  return h('div.parameters', [
    ...rowsOf(front),
    h('details.more', { open: isOpen }, [
      h('summary', 'More'),
      ...rowsOf(behind),
      h('div.pair', ...others.filter(isNumber).map(elementFor)),
      ...others.filter((parameter) => !isNumber(parameter)).map(elementFor),
    ]),
  ]);
}
