// The volumes of a file of several, on a slider with a picture of each, before one is chosen.
import type { Choice } from '../../api/types';
import { button, h, uniqueId } from '../../ui/dom';
import { greys, imageOf, paintImage } from '../../ui/pixels';

// Draws it with its own pixels.
export function paintPicture({ width, height, grey }: NonNullable<Choice['picture']>, canvas: HTMLCanvasElement): void {
  const values = Uint8Array.from(atob(grey), (letter) => letter.charCodeAt(0));
  paintImage(canvas, imageOf({ width, height, values }, greys));
}

// All of them have pictures.
export function timeChoice(choices: readonly Choice[], onChoice: (value: string) => void): HTMLElement {
  const id = uniqueId('volume');
  const canvas = h('canvas', { role: 'img' });
  const slider = h('input', { type: 'range', id, min: 0, max: choices.length - 1, step: 1, value: 0, 'aria-label': 'Volume of the file' });
  const title = h('output', { for: id });
  const chosen = (): Choice | undefined => choices[slider.valueAsNumber];
  const show = (): void => {
    const { value = '', title: named, picture } = chosen() ?? {};
    const text = named || `volume ${value}`;
    title.textContent = `${slider.valueAsNumber + 1} of ${choices.length}: ${text}`;
    slider.setAttribute('aria-valuetext', title.textContent);
    canvas.setAttribute('aria-label', `The middle slice of ${text}`);
    if (picture) paintPicture(picture, canvas);
  };
  slider.addEventListener('input', show);
  show();
  const use = button('Use this one', () => onChoice(chosen()?.value ?? ''), { class: 'primary' });
  return h('div.time-choice', canvas, h('div.time-choice-controls', title, slider, use));
}
