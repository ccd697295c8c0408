// How each of several surfaces is shown, and as a text for the address.
export interface SurfaceLook {
  colour: string;
  opacity: number;
  isShown: boolean;
}

// Apart for most eyes, also for those that tell red and green less well (Okabe and Ito).
const colours = ['#e8dcc0', '#56b4e9', '#e69f00', '#009e73', '#cc79a7', '#0072b2', '#d55e00', '#f0e442'];

// Colour, opacity in percent, and a minus where it is hidden: e8dcc0.100,56b4e9.40-
export function looksToText(looks: readonly SurfaceLook[]): string {
  return looks
    .map(({ colour, opacity, isShown }) => `${colour.slice(1)}.${Math.round(100 * opacity)}${isShown ? '' : '-'}`)
    .join(',');
}

// Of so many; what the text does not say, or says wrongly, is as usual.
export function looksOfText(text: string, count: number): SurfaceLook[] {
  const parts = text.split(',');
  return Array.from({ length: count }, (_, at) => {
    const found = /^([0-9a-f]{6})\.(\d{1,3})(-?)$/i.exec(parts[at] ?? '');
    const percent = Number(found?.[2] ?? 100);
    return {
      colour: found ? `#${found[1]?.toLowerCase() ?? ''}` : (colours[at % colours.length] as string),
      opacity: percent >= 10 && percent <= 100 ? percent / 100 : 1,
      isShown: found?.[3] !== '-',
    };
  });
}
