// The server's notes on a volume, in the page's words.
import type { Volume } from '../api/types';
import { isInteger } from './names';

// The button that makes surfaces of labels. Only volumes of whole values have it.
export const eachLabel = 'Each label';

// The server does not know the page's buttons, so the page adds which one to use.
export function noteTexts(volume: Volume): string[] {
  return volume.notes.map(({ code, detail }) =>
    code === 'looks-like-labels' && isInteger(volume) ? `${detail} The button "${eachLabel}" makes one surface for each label.` : detail,
  );
}
