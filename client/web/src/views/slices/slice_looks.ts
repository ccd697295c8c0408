// How slices are looked at, on the whole page: their colours, and the coordinates that are told.
import type { Vec3 } from '../../api/types';
import { colourTable } from '../../scene/colour_map';
import { field, h, segmented, select } from '../../ui/dom';
import { formatNumber } from '../../ui/format';
import { Signal, type Scope } from '../../ui/signal';
import type { MeasureKind } from '../../volume/measure';
import { greyTable, textOfWindow, type Slice, type Window } from '../../volume/slices';
import { layoutNames, paneLayout } from './pane_area';
import type { SliceMeasures } from './slice_measure';

type ColourName = 'grey' | 'inverted' | 'hot' | 'even';
type Space = 'LPS' | 'RAS';

const colourNames: Record<ColourName, string> = { grey: 'Grey', inverted: 'Inverted', hot: 'Hot iron', even: 'Blue to yellow' };

export const sliceColours = new Signal<ColourName>('grey');
export const sliceSpace = new Signal<Space>('LPS');

// Null for a name that is none of those.
function one<T extends string>(text: string | null, known: Record<T, unknown>): T | null {
  return text !== null && Object.keys(known).includes(text) ? (text as T) : null;
}

const spaces: Record<Space, string> = { LPS: 'LPS', RAS: 'RAS' };

// As an address says; where it does not, as they were in the view before.
export function restoreLooks(query: URLSearchParams): void {
  sliceColours.value = one(query.get('colours'), colourNames) ?? sliceColours.value;
  sliceSpace.value = one(query.get('space'), spaces) ?? sliceSpace.value;
  paneLayout.value = one(query.get('layout'), layoutNames) ?? paneLayout.value;
}

// Calls it when one of them changes.
export function watchLooks(scope: Scope, onChange: () => void): void {
  for (const look of [sliceColours, sliceSpace, paneLayout]) scope.onEnd((look as Signal<unknown>).subscribe(onChange));
}

// For the address, where only what is not as usual is said.
export function looksInAddress(): Record<'colours' | 'space' | 'layout', string> {
  const [colours, space, layout] = [sliceColours.value, sliceSpace.value, paneLayout.value];
  return { colours: colours === 'grey' ? '' : colours, space: space === 'LPS' ? '' : space, layout: layout === 'grid' ? '' : layout };
}

// In Hounsfield units, as radiologists set them.
const ctWindows: readonly [string, Window][] = [
  ['Brain', [0, 80]],
  ['Lung', [-1350, 150]],
  ['Bone', [-500, 1300]],
  ['Abdomen', [-150, 250]],
];

// For each grey the pixel of a canvas.
export function pixelsOf(name: ColourName): Uint32Array {
  const even = name === 'even' ? colourTable(256) : null;
  const colourAt = (grey: number): readonly [number, number, number] => {
    if (even) return [even[4 * grey] ?? 0, even[4 * grey + 1] ?? 0, even[4 * grey + 2] ?? 0];
    if (name === 'hot') return [Math.min(255, 3 * grey), Math.max(0, Math.min(255, 3 * grey - 255)), Math.max(0, 3 * grey - 510)];
    const shown = name === 'inverted' ? 255 - grey : grey;
    return [shown, shown, shown];
  };
  return Uint32Array.from({ length: 256 }, (_, grey) => {
    const [red, green, blue] = colourAt(grey);
    return (0xff00_0000 | (blue << 16) | (green << 8) | red) >>> 0;
  });
}

// The same for each value of a slice, as it is seen in that window.
export function pixelsIn(slice: Pick<Slice, 'window'>, shown: Window): Uint32Array {
  const colours = pixelsOf(sliceColours.value);
  return Uint32Array.from(greyTable(slice, shown), (grey) => colours[grey] ?? 0);
}

// The letters of the patient's sides, so far from the edges of the canvas.
export function paintLetters(context: CanvasRenderingContext2D, sides: Record<'left' | 'right' | 'top' | 'bottom', string>, edge: number, ratio: number): void {
  const { width, height } = context.canvas;
  context.save();
  context.font = `600 ${11 * ratio}px system-ui, sans-serif`;
  context.fillStyle = 'rgba(255, 255, 255, 0.75)';
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillText(sides.left, edge, height / 2);
  context.fillText(sides.right, width - edge, height / 2);
  context.fillText(sides.top, width / 2, edge);
  context.fillText(sides.bottom, width / 2, height - edge);
  context.restore();
}

// In millimetres, with digits enough to tell neighbouring samples apart.
export function placeText([left, posterior, superior]: Vec3, space: Space, spacing: Vec3): string {
  const digits = Math.max(1, 1 - Math.floor(Math.log10(Math.min(...spacing))));
  const sign = space === 'RAS' ? -1 : 1;
  return `${space} ${[sign * left, sign * posterior, superior].map((value) => formatNumber(value, digits)).join(', ')} mm`;
}

// One of those names for the whole page.
function lookChoice<T extends string>(label: string, names: Record<T, string>, look: Signal<T>): HTMLElement {
  return field(label, select(Object.entries(names) as [T, string][], look.value, (name) => (look.value = name)));
}

function layoutChoice(): HTMLElement {
  const choice = lookChoice('Layout', layoutNames, paneLayout);
  choice.classList.add('layout-choice');
  return choice;
}

// The name of a window for CT; '' for any other one.
export function windowName(window: Window, usual: Window): string {
  const windows = [['Usual', usual] as const, ...ctWindows];
  // An address has fewer digits than the usual window.
  return windows.find(([, known]) => textOfWindow(known) === textOfWindow(window))?.[0] ?? '';
}

// Says which of the windows for CT is shown.
export class WindowChoice {
  readonly element: HTMLElement;
  private readonly choice: HTMLSelectElement;
  // Cannot be chosen: it is the window that was made by dragging, or that an address says.
  private readonly custom = h('option', { value: '', hidden: true }, 'Custom');

  constructor(
    private readonly usual: Window,
    setWindow: (window: Window) => void,
  ) {
    const windows = [['Usual', usual] as const, ...ctWindows];
    this.choice = h('select', ...windows.map(([name]) => h('option', { value: name }, name)), this.custom);
    this.choice.addEventListener('change', () => {
      const chosen = windows.find(([name]) => name === this.choice.value);
      if (chosen) setWindow(chosen[1]);
    });
    this.element = field('Window', this.choice);
  }

  show(window: Window): void {
    const name = windowName(window, this.usual);
    this.custom.hidden = name !== '';
    this.choice.value = name;
  }
}

// `windows` is null where the usual windows for CT mean nothing.
export function sliceControls(windows: WindowChoice | null, measures: SliceMeasures): HTMLElement {
  const kinds = [
    { value: 'none', label: 'Off' },
    { value: 'length', label: 'Length', title: 'Click two points' },
    { value: 'angle', label: 'Angle', title: 'Click three points; the angle is at the second' },
    { value: 'area', label: 'Area', title: 'Click the corners; a double click closes it' },
  ] as const;
  return h('div.slice-controls', [
    h('div.row', [
      windows?.element,
      lookChoice('Colours', colourNames, sliceColours),
      layoutChoice(),
      lookChoice('Coordinates', spaces, sliceSpace),
    ]),
    segmented<MeasureKind | 'none'>('Measure in slices', kinds, 'none', (kind) => (measures.kind.value = kind === 'none' ? null : kind)),
  ]);
}
