import { button, h } from './dom';

const keys: [string, string][] = [
  ['g v', 'volumes'],
  ['g j', 'jobs'],
  ['g o', 'orders, where the server knows a PACS'],
  ['?', 'this list'],
  ['Ctrl Enter', 'make the surface'],
  ['Ctrl Z', 'take the last change of parameters back; with Shift do it again'],
  ['[', 'go to the line in the histogram'],
  ['arrows', 'in a slice: next slice; on the line: iso-value; on a surface: turn'],
  ['Ctrl wheel + \u2212 0', 'in a slice: zoom; all of it'],
  ['i', 'in a slice: its value at the cross becomes the iso-value'],
  ['Shift arrows', 'in a slice: window and level; on a surface: move'],
  ['+ \u2212', 'zoom'],
  ['a p l r s i', 'on a surface: standard views'],
  ['f', 'show all'],
  ['t w d', 'flat shading, wires, distances as colour'],
  ['c x m', 'cut, slices beside the surface, measure'],
  ['h o e', 'of labels: hide the picked one, show only it, show all'],
  ['Esc Delete', 'take the last point back, remove all distances'],
];

export function showHelp(): void {
  const dialog = h(
    'dialog',
    { class: 'dialog help', 'aria-label': 'Keys' },
    h('h2', {}, 'Keys'),
    h('dl', {}, ...keys.flatMap(([key, what]) => [
      h('dt', {}, ...key.split(' ').map((part) => h('kbd', {}, part))),
      h('dd', {}, what),
    ])),
    h('div', { class: 'actions' }, button('Close', () => dialog.close(), { autofocus: true })),
  );
  dialog.addEventListener('close', () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
