// How much is seen of labels within their outlines, in slices and cuts: one choice for the whole page.
import { h } from '../../ui/dom';
import { Signal } from '../../ui/signal';
import { coloursOf, paintLabels, type LabelLook, type NumberedSlice } from '../../volume/label_map';

export const labelOpacity = new Signal(0.75);

export function labelImage(slice: NumberedSlice, look: LabelLook, opacity = labelOpacity.value): ImageData {
  return new ImageData(paintLabels(slice, coloursOf(look), opacity), slice.width, slice.height);
}

export function opacityControl(): HTMLElement {
  const input = h('input', { type: 'range', min: 0, max: 1, step: 0.05, value: labelOpacity.value, 'aria-label': 'Opacity of labels in slices' });
  input.addEventListener('input', () => (labelOpacity.value = input.valueAsNumber));
  return h('label.label-opacity', h('span', 'Labels in slices'), input);
}
