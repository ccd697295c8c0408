// A table whose rows are cards on a phone. Its roles are told: a table that is not laid out as one loses them.
import { h, type Attribute, type Child } from './dom';

export function cell(...children: Child[]): HTMLElement {
  return h('td', { role: 'cell' }, ...children);
}

export function row(attributes: Record<string, Attribute>, ...cells: HTMLElement[]): HTMLElement {
  return h('tr', { role: 'row', ...attributes }, ...cells);
}

// The names of columns in `unseen` are for those who hear the table.
export function table(columns: readonly string[], unseen: readonly string[], rows: readonly HTMLElement[]): HTMLTableElement {
  const heads = columns.map((name) =>
    h('th', { scope: 'col', role: 'columnheader' }, h('span', { class: unseen.includes(name) ? 'sr-only' : '' }, name)),
  );
  return h(
    'table',
    { class: 'jobs', role: 'table' },
    h('thead', { role: 'rowgroup' }, row({}, ...heads)),
    h('tbody', { role: 'rowgroup' }, ...rows),
  );
}
