// One of several panes takes the room of all, and gives it back: by a button below it or a double click beside that.
import { button, icon } from '../../ui/dom';

const corners = 'M2.5 6V2.5H6M10 2.5h3.5V6M13.5 10v3.5H10M6 13.5H2.5V10';

export function makeEnlargeable(area: HTMLElement, panes: readonly { element: HTMLElement; name: string }[]): void {
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
