// How a surface is looked at, as texts for the address: its style, what is measured, which labels are hidden.
import type { Label, Vec3 } from '../../api/types';
import { labelFrom } from '../../job/parameters';
import { defaultStyle, type Ruler, type SurfaceStyle } from '../../scene/style';

const mostRulers = 32;

// flat,wires,distance,opacity-40: what is not as usual.
export function styleToText({ shading, wireframe, distance, opacity }: SurfaceStyle): string {
  return [
    shading === 'flat' && 'flat',
    wireframe && 'wires',
    distance && 'distance',
    opacity < 1 && `opacity-${Math.round(100 * opacity)}`,
  ]
    .filter(Boolean)
    .join(',');
}

export function styleOfText(text: string): SurfaceStyle {
  const words = text.split(',');
  const percent = Number(words.find((word) => word.startsWith('opacity-'))?.slice('opacity-'.length) ?? 100);
  return {
    ...defaultStyle,
    shading: words.includes('flat') ? 'flat' : 'smooth',
    wireframe: words.includes('wires'),
    distance: words.includes('distance'),
    opacity: percent >= 10 && percent < 100 ? percent / 100 : 1,
  };
}

// Six numbers in millimetres for each. The digits serve bodies of any size.
export function rulersToText(rulers: readonly Ruler[]): string {
  return rulers.map(({ from, to }) => [...from, ...to].map((value) => Number(value.toPrecision(6))).join(',')).join(';');
}

export function rulersOfText(text: string): Ruler[] {
  return text
    .split(';')
    .slice(0, mostRulers)
    .flatMap((one) => {
      const numbers = one.split(',').map(Number);
      if (one === '' || numbers.length !== 6 || !numbers.every(Number.isFinite)) return [];
      return [{ from: numbers.slice(0, 3) as Vec3, to: numbers.slice(3) as Vec3 }];
    });
}

export function labelsOfText(text: string): Set<Label> {
  return new Set(text.split(',').filter((one) => /^-?\d+$/.test(one)).map(labelFrom));
}
