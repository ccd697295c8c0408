// Numbers as people type them.

// A minus may also be the sign that the page itself writes.
const plain = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
// Spaces between groups of three digits, as the page writes large numbers.
const groups = /(?<=\d)[ \u00a0\u2009\u202f](?=\d{3}(?!\d))/g;
// One thousand for some, one and a quarter for others: 1,250.
const eitherWay = /^[+-]?[1-9]\d{0,2},\d{3}$/;

function tidied(text: string): string {
  return text.trim().replace('\u2212', '-').replaceAll(groups, '');
}

// Null for no text; NaN for a text that is no number, or that could be two. One comma is the decimal separator.
export function numberOf(text: string): number | null {
  const given = tidied(text);
  if (given === '') return null;
  if (eitherWay.test(given) || given.indexOf(',') !== given.lastIndexOf(',')) return NaN;
  const value = given.replace(',', '.');
  return plain.test(value) && Number.isFinite(Number(value)) ? Number(value) : NaN;
}

// The reason why a text is no number; empty if it is one, or is empty.
export function textFault(text: string): string {
  if (!Number.isNaN(numberOf(text))) return '';
  const given = tidied(text);
  if (eitherWay.test(given)) {
    return `${given} can mean ${given.replace(',', '.')} or ${given.replace(',', '')}. Enter one of these.`;
  }
  const hasMany = (given.match(/[.,]/g)?.length ?? 0) > 1;
  return hasMany ? 'Enter a number with one decimal point, and nothing between its thousands.' : 'Enter a number.';
}

// The numbers of "0.5, 0.5, 2", "0.5x0.5x2", "0,5 0,5 2" or "0,5; 0,5; 2 mm"; NaN for a part that is no number. A comma between
// digits belongs to its number where something else separates the numbers.
export function numbersOf(text: string): number[] {
  const given = text.trim().replace(/\s*mm$/i, '');
  const byOthers = given.split(/\s*[;x\u00d7*]\s*|\s+/i);
  const isOne = byOthers.length > 1 && byOthers.every((part) => part !== '' && !part.endsWith(',') && !part.startsWith(','));
  return (isOne ? byOthers : given.split(/\s*,\s*/)).map((part) => numberOf(part) ?? NaN);
}

export interface Steps {
  step?: number;
  min?: number | undefined;
  max?: number | undefined;
}

// The value one step up (1) or down (-1), within the limits. Steps start at 0 if there is no value.
export function stepped(value: number | null, direction: 1 | -1, { step = 1, min = -Infinity, max = Infinity }: Steps): number {
  // Twelve digits are enough for every step, and drop the rest that binary fractions leave.
  const next = Number(((value ?? 0) + direction * step).toPrecision(12));
  return Math.min(max, Math.max(min, next));
}
