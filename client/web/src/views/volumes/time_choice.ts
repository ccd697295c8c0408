// The volumes of a file of several, on a slider with a picture of each, before one is chosen.
import type { Choice } from '../../api/types';
import { button, h, uniqueId } from '../../ui/dom';
import { greys, imageOf, paintImage } from '../../ui/pixels';
import { readTimePoints, type Picture } from '../../volume/time_points';

// Draws it with its own pixels.
export function paintPicture({ width, height, grey }: Picture, canvas: HTMLCanvasElement): void {
  paintImage(canvas, imageOf({ width, height, values: grey }, greys));
}

// Stays hidden where the page cannot read the file.
export function timeChoice(choices: readonly Choice[], file: Blob, onChoice: (value: string) => void): HTMLElement {
  const id = uniqueId('volume');
  const pictures: Picture[] = [];
  const canvas = h('canvas', { width: 1, height: 1, role: 'img' });
  const slider = h('input', { type: 'range', id, min: 0, max: choices.length - 1, step: 1, value: 0, 'aria-label': 'Volume of the file' });
  const title = h('output', { for: id });
  const chosen = (): Choice | undefined => choices[slider.valueAsNumber];
  const show = (): void => {
    const at = slider.valueAsNumber;
    const text = chosen()?.title || `volume ${chosen()?.value ?? ''}`;
    title.textContent = `${at + 1} of ${choices.length}: ${text}`;
    slider.setAttribute('aria-valuetext', title.textContent);
    canvas.setAttribute('aria-label', `The middle slice of ${text}`);
    canvas.dataset.shown = pictures[at] ? String(at) : '';
    const picture = pictures[at];
    if (picture) paintPicture(picture, canvas);
  };
  slider.addEventListener('input', show);
  const use = button('Use this one', () => onChoice(chosen()?.value ?? ''), { class: 'primary' });
  const element = h('div.time-choice', { hidden: true }, canvas, h('div.time-choice-controls', title, slider, use));
  const reading = new AbortController();
  use.addEventListener('click', () => reading.abort());
  const take = (index: number, picture: Picture): void => {
    // The view has gone.
    if (index > 0 && !element.isConnected) reading.abort();
    pictures[index] = picture;
    element.hidden = false;
    if (index === slider.valueAsNumber) show();
  };
  // The browser cannot read the file any more, or it is broken: the daemon says so. The list is enough to choose.
  readTimePoints(file, take, reading.signal).catch(() => undefined);
  return element;
}
