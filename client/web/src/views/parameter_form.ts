// The parameters of a job beside its iso-value.
import { meshFormats, type JobParameters, type MeshFormat } from '../api/types';
import { checkbox, field, h, segmented } from '../ui/dom';
import { formatNames } from '../ui/format';
import { withGlb } from '../volume/parameters';

export type Change = Partial<JobParameters>;

function numberInput(
  value: number,
  limits: { min: number; max: number; step: number },
  onChange: (value: number) => void,
): HTMLInputElement {
  const input = h('input', { type: 'number', inputmode: 'decimal', value, ...limits });
  input.addEventListener('input', () => {
    const isGood = input.value !== '' && input.validity.valid;
    input.toggleAttribute('aria-invalid', !isGood);
    if (isGood) onChange(input.valueAsNumber);
  });
  return input;
}

// Empty means null: no limit, or the default.
function optionalInput(
  value: number | null | undefined,
  limits: { min: number; max?: number; step: number | 'any' },
  onChange: (value: number | null) => void,
): HTMLInputElement {
  const input = h('input', { type: 'number', inputmode: 'decimal', value: value ?? '', ...limits });
  input.addEventListener('input', () => {
    input.toggleAttribute('aria-invalid', !input.validity.valid);
    if (input.validity.valid) onChange(input.value === '' ? null : input.valueAsNumber);
  });
  return input;
}

function formatBoxes(formats: readonly MeshFormat[], onChange: (formats: MeshFormat[]) => void): HTMLElement {
  const chosen = new Set<MeshFormat>(formats);
  return h(
    'fieldset',
    { class: 'boxes' },
    h('legend', {}, 'Files to make'),
    ...meshFormats.map((format) =>
      checkbox(
        formatNames[format] ?? format,
        chosen.has(format),
        (isOn) => {
          if (isOn) chosen.add(format);
          else chosen.delete(format);
          onChange(withGlb([...chosen]));
        },
        // The page shows this one.
        format === 'glb' ? { disabled: true } : {},
      ),
    ),
  );
}

export function parameterForm(parameters: JobParameters, onChange: (change: Change) => void): HTMLElement {
  const { draco } = parameters;
  let bits = draco.position_bits;
  let speed = draco.speed;
  const tellDraco = (): void => onChange({ draco: { position_bits: bits, speed } });
  let components = parameters.components ?? { keep: null, min_triangles: null };
  const tellComponents = (change: Partial<typeof components>): void => {
    components = { ...components, ...change };
    onChange({ components });
  };
  // The labels and titles of what the job's member of that name may be.
  const choice = <Member extends 'interpolation' | 'smoothing' | 'priority'>(
    member: Member,
    label: string,
    texts: Record<JobParameters[Member], [label: string, title: string]>,
  ): HTMLElement =>
    segmented(
      label,
      Object.entries<[string, string]>(texts).map(([value, [text, title]]) => ({ value, label: text, title })),
      parameters[member],
      (value) => onChange({ [member]: value }),
    );
  return h(
    'div',
    { class: 'parameters' },
    h(
      'div',
      { class: 'pair' },
      segmented(
        'Tetrahedra per cell',
        [
          { value: '5', label: '5', title: 'Fewer triangles; every second cell is mirrored' },
          { value: '6', label: '6', title: 'The same split in every cell' },
        ],
        String(parameters.scheme) as '5' | '6',
        (value) => onChange({ scheme: value === '5' ? 5 : 6 }),
      ),
      choice('interpolation', 'Vertices on edges', {
        linear: ['Linear', 'Where the iso-value lies between two samples'],
        midpoint: ['Midpoint', 'Half-way between two samples'],
      }),
    ),
    h(
      'div',
      { class: 'pair uneven' },
      choice('smoothing', 'Smoothing', {
        laplacian: ['Laplacian', 'Shrinks a little with every pass'],
        taubin: ['Taubin', 'Keeps the enclosed volume'],
      }),
      field(
        'Passes',
        numberInput(parameters.passes, { min: 0, max: 1000, step: 1 }, (passes) => onChange({ passes })),
      ),
    ),
    choice('priority', 'Priority', {
      stat: ['Stat', 'Before all others'],
      routine: ['Routine', 'After all that are stat'],
      bulk: ['Bulk', 'When nothing else waits'],
    }),
    h(
      'details',
      { class: 'more' },
      h('summary', {}, 'More'),
      h(
        'div',
        { class: 'pair' },
        field(
          'Step of a pass (0 to 1)',
          optionalInput(parameters.lambda, { min: 0.01, max: 1, step: 0.01 }, (lambda) => onChange({ lambda })),
        ),
        field(
          'Move at most, in mm',
          optionalInput(parameters.max_displacement_mm, { min: 0, step: 'any' }, (value) =>
            onChange({ max_displacement_mm: value }),
          ),
        ),
        field(
          'Keep the largest parts',
          optionalInput(components.keep, { min: 1, step: 1 }, (keep) => tellComponents({ keep })),
        ),
        field(
          'Parts of at least, triangles',
          optionalInput(components.min_triangles, { min: 1, step: 1 }, (value) =>
            tellComponents({ min_triangles: value }),
          ),
        ),
      ),
      h('p', { class: 'hint' }, 'Empty: the default step, no limit, all parts.'),
      checkbox('Close the surface at the border of the volume', parameters.close, (close) =>
        onChange({ close }),
      ),
      formatBoxes(parameters.formats, (formats) => onChange({ formats })),
      h(
        'div',
        { class: 'pair' },
        field(
          'Bits per coordinate',
          numberInput(bits, { min: 8, max: 30, step: 1 }, (value) => {
            bits = value;
            tellDraco();
          }),
        ),
        field(
          'Encoding speed',
          numberInput(speed, { min: 0, max: 10, step: 1 }, (value) => {
            speed = value;
            tellDraco();
          }),
        ),
      ),
    ),
  );
}
