// A table whose rows are cards on a phone. Its roles are told: a table that is not laid out as one loses them.
import { h, type Attribute, type Child } from './dom';

export function cell(...children: Child[]): HTMLElement {
  return h('td', { role: 'cell' }, ...children);
}

export function row(attributes: Record<string, Attribute>, ...cells: HTMLElement[]): HTMLElement {
  return h('tr', { role: 'row', ...attributes }, ...cells);
}

// Replaces rows; whoever is on one of them with the keyboard stays there. `name` is the data attribute with a row's id.
export function keepFocus(body: HTMLElement, name: 'job' | 'order', replace: () => void): void {
  const { activeElement } = document;
  const id = activeElement?.closest('tr')?.dataset[name];
  const label = activeElement?.getAttribute('aria-label');
  replace();
  if (id === undefined || !label) return;
  body.querySelector<HTMLElement>(`tr[data-${name}="${id}"] [aria-label="${label}"]`)?.focus();
}

// The names of columns in `unseen` are for those who hear the table.
export function table(columns: readonly string[], unseen: readonly string[], rows: readonly HTMLElement[]): HTMLTableElement {
  const heads = columns.map((name) =>
    h('th', { scope: 'col', role: 'columnheader' }, h('span', { class: unseen.includes(name) ? 'sr-only' : '' }, name)),
  );
  return h('table.jobs', { role: 'table' }, [
    h('thead', { role: 'rowgroup' }, row({}, ...heads)),
    h('tbody', { role: 'rowgroup' }, ...rows),
  ]);
}
