// The panes of a view beside each other, in a layout that a person chooses for all views. One of them can take the room of all, and
// gives it back: by a button below it or a double click beside that.
import { button, h, icon } from '../../ui/dom';
import { Signal, type Scope } from '../../ui/signal';

export interface Pane {
  element: HTMLElement;
  name: string;
}

export type Layout = 'grid' | 'large' | 'row';
export const layoutNames: Record<Layout, string> = { grid: 'All alike', large: 'First large', row: 'Side by side' };
export const paneLayout = new Signal<Layout>('grid');

const corners = 'M2.5 6V2.5H6M10 2.5h3.5V6M13.5 10v3.5H10M6 13.5H2.5V10';

export function paneArea(scope: Scope, panes: readonly Pane[]): HTMLElement {
  const area = h('section.slices', { 'aria-label': 'Slices' }, ...panes.map(({ element }) => element));
  makeEnlargeable(area, panes);
  scope.onEnd(paneLayout.watch((layout) => (area.dataset.layout = layout)));
  return area;
}

function makeEnlargeable(area: HTMLElement, panes: readonly Pane[]): void {
  const buttons = panes.map(({ element, name }) => {
    const toggle = (): void => {
      const isOn = area.dataset.enlarged !== name;
      for (const pane of panes) pane.element.classList.toggle('enlarged', isOn && pane.element === element);
      if (isOn) area.dataset.enlarged = name;
      else delete area.dataset.enlarged;
      for (const one of buttons) one.setAttribute('aria-pressed', String(isOn && one === own));
    };
    const own = button(icon(corners), toggle, { class: 'enlarge', 'aria-label': `Enlarge ${name}`, 'aria-pressed': 'false', title: 'Show this alone, or all (double click on this bar)' });
    const caption = element.querySelector('figcaption');
    caption?.append(own);
    caption?.addEventListener('dblclick', (event) => {
      if (!(event.target as Element).closest('button, input, select')) toggle();
    });
    return own;
  });
}
