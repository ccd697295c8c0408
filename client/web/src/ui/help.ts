import { button, h } from './dom';

const keys: [string, string][] = [
  ['g v', 'go to the volumes'],
  ['g j', 'go to the jobs'],
  ['g o', 'go to the orders, if the server knows a PACS'],
  ['?', 'show this list'],
  ['Ctrl Enter', 'make the surface'],
  ['Ctrl Z', 'undo the last change of a parameter; with Shift: redo'],
  ['[', 'move the focus to the line in the histogram'],
  ['arrows', 'slice: next or previous slice; histogram line: iso-value; surface: turn'],
  ['Ctrl wheel + \u2212 0', 'slice: zoom; 0 shows the whole slice'],
  ['i', 'slice: use the value at the cross as the iso-value; in a slab, the value in its middle slice'],
  ['Shift arrows', 'slice: change window and level; surface: move'],
  ['+ \u2212', 'zoom'],
  ['a p l r s i', 'surface: standard views'],
  ['f', 'surface: show the whole surface'],
  ['t w d', 'surface: flat shading, edges only, colours by distance'],
  ['c x m', 'surface: cut, show slices beside it, measure'],
  ['h o e', 'labels: hide the selected label, show only it, show all'],
  ['Esc Delete', 'measuring, also in slices: remove the last, remove all'],
];

export function showHelp(): void {
  const dialog = h('dialog.dialog.help', { 'aria-label': 'Keyboard shortcuts' }, [
    h('h2', { tabindex: '-1', autofocus: true }, 'Keyboard shortcuts'),
    h('dl', ...keys.flatMap(([key, what]) => [
      h('dt', ...key.split(' ').map((part) => h('kbd', part))),
      h('dd', what),
    ])),
    h('div.actions', button('Close', () => dialog.close())),
  ]);
  dialog.addEventListener('close', () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
