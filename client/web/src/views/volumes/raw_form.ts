import type { RawDescription, SampleType } from '../../api/types';
import { button, field, h } from '../../ui/dom';
import { rawFault, sampleBytes } from '../../volume/raw';

type Triple = [number, number, number];

function triple(label: string, values: Triple, step: string): { element: HTMLElement; read: () => Triple } {
  const inputs = values.map((value, axis) =>
    h('input', {
      type: 'number',
      value: value > 0 ? value : '',
      min: 0,
      step,
      'aria-label': `${label} along ${'xyz'[axis] ?? ''}`,
    }),
  );
  return {
    element: h(
      'fieldset',
      { class: 'triple' },
      h('legend', {}, label),
      ...inputs,
    ),
    read: () => inputs.map((input) => input.valueAsNumber) as Triple,
  };
}

// Asks for what raw samples do not say themselves.
export function rawForm(size: number, onDescribed: (raw: RawDescription) => void): HTMLElement {
  const dims = triple('Samples', [0, 0, 0], '1');
  const spacing = triple('Spacing in mm', [1, 1, 1], 'any');
  const type = h(
    'select',
    {},
    ...Object.keys(sampleBytes).map((name) => h('option', { value: name, selected: name === 'int16' }, name)),
  );
  const chosenType = (): SampleType => type.value as SampleType;
  const order = h(
    'select',
    {},
    h('option', { value: 'little' }, 'little-endian'),
    h('option', { value: 'big' }, 'big-endian'),
  );
  const fault = h('p', { class: 'warning', role: 'status' });
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
      rawFault(size, dims.read(), chosenType()) ||
      (spacing.read().every((value) => value > 0) ? '' : 'The spacing must be positive.');
    fault.textContent = missing;
    submit.disabled = missing !== '';
  };
  const form = h(
    'div',
    { class: 'raw' },
    h('h3', {}, 'Are these raw samples?'),
    h('p', {}, 'Enter the number of samples along x, y and z. x changes fastest.'),
    dims.element,
    h('div', { class: 'pair' }, field('Type', type), field('Byte order', order)),
    spacing.element,
    fault,
    h('div', { class: 'actions' }, submit),
  );
  form.addEventListener('input', check);
  return form;
}
