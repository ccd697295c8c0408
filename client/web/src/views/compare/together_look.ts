// How each of several surfaces is shown, and as a text for the address.
export interface SurfaceLook {
  colour: string; // #rrggbb, or '' where each label has its own
  opacity: number;
  isShown: boolean;
}

// Apart for most eyes, also for those that tell red and green less well (Okabe and Ito).
const colours = ['#e8dcc0', '#56b4e9', '#e69f00', '#009e73', '#cc79a7', '#0072b2', '#d55e00', '#f0e442'];

// Colour, opacity in percent, and a minus where it is hidden: e8dcc0.100,56b4e9.40-,own.100
export function looksToText(looks: readonly SurfaceLook[]): string {
  return looks
    .map(({ colour, opacity, isShown }) => `${colour === '' ? 'own' : colour.slice(1)}.${Math.round(100 * opacity)}${isShown ? '' : '-'}`)
    .join(',');
}

export function usual(at: number): string {
  return colours[at % colours.length] as string;
}

function colourOf(word: string, hasLabels: boolean, at: number): string {
  if (word !== 'own') return `#${word}`;
  return hasLabels ? '' : usual(at);
}

// Of so many; what the text does not say, or says wrongly, is as usual: where there are labels, in their colours.
export function looksOfText(text: string, haveLabels: readonly boolean[]): SurfaceLook[] {
  const parts = text.split(',');
  return haveLabels.map((hasLabels, at) => {
    const found = /^([0-9a-f]{6}|own)\.(\d{1,3})(-?)$/i.exec(parts[at] ?? '');
    const percent = Number(found?.[2] ?? 100);
    return {
      colour: colourOf(found?.[1]?.toLowerCase() ?? (hasLabels ? 'own' : usual(at).slice(1)), hasLabels, at),
      opacity: percent >= 10 && percent <= 100 ? percent / 100 : 1,
      isShown: found?.[3] !== '-',
    };
  });
}
