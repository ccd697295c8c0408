// All views of surfaces have these: buttons for the camera, and its place in the address.
import { placeToText, viewNames, viewTitles, type CameraPlace, type ViewName } from '../../scene/views';
import { button } from '../../ui/dom';
import { noteInAddress } from '../../ui/route';
import type { Scope } from '../../ui/signal';

const noteDelay = 300;

// With `hasKeys` their titles say which key does the same.
export function viewButtons(look: (view: ViewName) => void, fit: () => void, hasKeys = false): HTMLElement[] {
  const keyOf = (name: ViewName): string => (hasKeys ? ` (${name.toLowerCase()})` : '');
  return [
    ...viewNames.map((name) => button(name, () => look(name), { 'aria-label': viewTitles[name], title: viewTitles[name] + keyOf(name) })),
    button('Fit', fit, hasKeys ? { title: 'Show the whole surface (f)' } : {}),
  ];
}

// To be called with each place of a camera; the one where it rests is noted.
export function cameraNote(scope: Scope): (place: CameraPlace) => void {
  let noting = 0;
  scope.onEnd(() => clearTimeout(noting));
  return (place) => {
    clearTimeout(noting);
    noting = window.setTimeout(() => noteInAddress({ cam: placeToText(place) }), noteDelay);
  };
}
