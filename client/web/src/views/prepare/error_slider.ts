// The largest error that a job may have, as a slider: logarithmic, and off at its left end.
import type { Value } from '../../job/table';
import { h, uniqueId } from '../../ui/dom';
import { formatNumber, formatValue } from '../../ui/format';

const least = 0.02;
const most = 2;
const steps = 60; // beside off

// The error at a place of the slider, rounded to two significant digits; null at 0, for no limit.
export function errorAt(place: number): number | null {
  if (place <= 0) return null;
  const exact = least * (most / least) ** ((Math.min(place, steps) - 1) / (steps - 1));
  return Number(exact.toPrecision(2));
}

// The place nearest to that error; those that lie beyond are at the ends.
export function placeOf(error: number | null): number {
  if (error === null) return 0;
  const place = 1 + (steps - 1) * (Math.log(error / least) / Math.log(most / least));
  return Math.min(steps, Math.max(1, Math.round(place)));
}

// Beside the volume's smallest spacing.
export function errorInWords(error: number | null, spacing: readonly number[]): string {
  if (error === null) return 'off';
  const smallest = Math.min(...spacing);
  const share = error / smallest;
  const times = share < 0.095 ? formatNumber(share, 3) : formatNumber(share, 2);
  return `${formatValue(error)} mm, ${times} \u00d7 the spacing of ${formatNumber(smallest, 3)} mm`;
}

export interface SliderHost {
  spacing: readonly number[];
  // Shows the estimated result below the slider.
  outcome: HTMLElement;
}

export function errorSlider(
  label: string,
  value: number | null,
  { spacing, outcome }: SliderHost,
  set: (value: Value) => void,
): HTMLElement {
  const id = uniqueId('error');
  const slider = h('input', { type: 'range', id, min: 0, max: steps, step: 1, value: placeOf(value) });
  const words = h('output', { for: id });
  const show = (error: number | null): void => {
    words.textContent = errorInWords(error, spacing);
    slider.setAttribute('aria-valuetext', words.textContent);
  };
  slider.addEventListener('input', () => {
    const error = errorAt(slider.valueAsNumber);
    show(error);
    set(error);
  });
  show(value);
  return h('div.field.error-slider', [
    h('div.slider-head', h('label', { for: id }, label), words),
    slider,
    outcome,
  ]);
}
