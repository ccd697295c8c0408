import type { RawDescription, SampleType } from '../../api/types';
import { button, field, h, select } from '../../ui/dom';
import { NumberField } from '../../ui/number_field';
import { rawFault, sampleArrays } from '../../volume/raw';

type Triple = [number, number, number];

interface TripleField {
  element: HTMLElement;
  // NaN for what is missing or no number.
  read: () => Triple;
  // Marks the texts that are no numbers, and those that are not as they have to be. Says why the first is no number.
  check: (fits: (value: number) => boolean, rule: string) => string;
}

function triple(label: string, values: Triple): TripleField {
  const fields = values.map((value, axis) => {
    const made = new NumberField({ min: 0 }, { 'aria-label': `${label} along ${'xyz'[axis] ?? ''}` });
    made.write(value > 0 ? value : null);
    return made;
  });
  return {
    element: h('fieldset.triple', [
      h('legend', label),
      ...fields.map(({ input }) => input),
    ]),
    read: () => fields.map(({ value }) => value ?? NaN) as Triple,
    check: (fits, rule) => {
      for (const one of fields) one.mark(one.textFault || (one.value === null || fits(one.value) ? '' : rule));
      return fields.map((one) => one.textFault).find(Boolean) ?? '';
    },
  };
}

const positive = 'The spacing must be positive.';

const unknown: RawDescription = { dims: [0, 0, 0], type: 'int16', spacing: [1, 1, 1], byteOrder: 'little' };

// Asks for what raw samples do not say themselves. `described`: as they were described before.
export function rawForm(size: number, onDescribed: (raw: RawDescription) => void, described = unknown): HTMLElement {
  const dims = triple('Samples', described.dims);
  const spacing = triple('Spacing in mm', described.spacing);
  const type = select(Object.keys(sampleArrays).map((name) => [name, name]), described.type);
  const chosenType = (): SampleType => type.value as SampleType;
  const order = select([['little', 'little-endian'], ['big', 'big-endian']], described.byteOrder);
  const fault = h('p.warning', { role: 'status' });
  const submit = button(
    'Upload as raw samples',
    () =>
      onDescribed({
        dims: dims.read(),
        type: chosenType(),
        spacing: spacing.read(),
        byteOrder: order.value === 'big' ? 'big' : 'little',
      }),
    { class: 'primary', disabled: true },
  );
  const check = (): void => {
    const missing =
      dims.check((count) => Number.isInteger(count) && count > 0, 'Enter a positive whole number.') ||
      spacing.check((value) => value > 0, positive) ||
      rawFault(size, dims.read(), chosenType()) ||
      (spacing.read().every((value) => value > 0) ? '' : positive);
    fault.textContent = missing;
    submit.disabled = missing !== '';
  };
  const form = h('div.raw', [
    h('h3', 'Are these raw samples?'),
    h('p', 'Enter the number of samples along x, y and z. x changes fastest.'),
    dims.element,
    h('div.pair', field('Type', type), field('Byte order', order)),
    spacing.element,
    fault,
    h('div.actions', submit),
  ]);
  form.addEventListener('input', check);
  if (described !== unknown) check();
  return form;
}
