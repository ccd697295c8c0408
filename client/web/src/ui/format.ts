// Numbers and times for people.
import { meshFileSuffixes, meshFormatTitles, volumeFormats } from '../../generated/parameters';

const plain = new Intl.NumberFormat('en', { maximumFractionDigits: 0 });

export function formatCount(value: number): string {
  return plain.format(value).replaceAll(',', '\u202f');
}

// At most that many digits after the point.
export function formatNumber(value: number, digits = 2): string {
  const text = new Intl.NumberFormat('en', { maximumFractionDigits: digits }).format(value);
  // Rounded to zero, which has no sign.
  if (text === '-0') return '0';
  return text
    .replaceAll(',', '\u202f')
    .replace('-', '\u2212');
}

// The power of ten of a number's first digit: 2 for hundreds.
function magnitudeOf(value: number): number {
  return Math.floor(Math.log10(Math.abs(value)));
}

const mostDigits = 17; // a double has no more

// As short as tells it apart from others in a range of that length, however far from zero that range lies.
export function shortened(value: number, span: number, least = 6): number {
  const needed = value !== 0 && span > 0 ? 6 + magnitudeOf(value) - magnitudeOf(span) : least;
  return Number(value.toPrecision(Math.min(mostDigits, Math.max(least, needed))));
}

// Four digits that count, for values of any size; more where values of a range of that length need them to be told apart.
export function formatValue(value: number, span = Infinity): string {
  if (value === 0) return '0';
  const size = Math.abs(value);
  const needed = span > 0 ? 2 - magnitudeOf(span) : 0; // digits after the point
  if (size < 1e-4) return value.toExponential(Math.min(mostDigits, Math.max(2, needed + magnitudeOf(size))));
  const usual = size >= 1000 ? 0 : Math.max(0, 3 - magnitudeOf(size));
  return formatNumber(value, Math.min(mostDigits, Math.max(usual, needed)));
}

// Lengths and areas have one digit after the point, small ones three digits that count.
export function formatSize(value: number): string {
  const size = Math.abs(value);
  if (size >= 1 || size === 0) return formatNumber(value, 1);
  return size < 1e-4 ? formatValue(value) : formatNumber(value, 2 - Math.floor(Math.log10(size)));
}

export function formatIso(iso: number | string): string {
  if (typeof iso === 'number') return formatValue(iso);
  return iso === 'otsu' ? 'Otsu' : iso;
}

const units = ['B', 'KB', 'MB', 'GB', 'TB'];

export function formatBytes(bytes: number): string {
  let value = bytes;
  let unit = 0;
  while (value >= 999.5 && unit < units.length - 1) {
    value /= 1000;
    unit += 1;
  }
  return `${unit === 0 || value >= 99.95 ? value.toFixed(0) : value.toFixed(1)} ${units[unit] ?? ''}`;
}

export function formatMilliseconds(milliseconds: number): string {
  if (milliseconds < 1) return '< 1 ms';
  // The limits are where rounding reaches the next unit.
  if (milliseconds < 999.5) return `${milliseconds.toFixed(0)} ms`;
  if (milliseconds < 59_950) return `${(milliseconds / 1000).toFixed(milliseconds < 9995 ? 2 : 1)} s`;
  const seconds = Math.round(milliseconds / 1000);
  return `${Math.floor(seconds / 60)} min ${seconds % 60} s`;
}

export function formatTime(iso: string): string {
  const date = new Date(iso);
  if (Number.isNaN(date.getTime())) return iso;
  const isToday = date.toDateString() === new Date().toDateString();
  const time = date.toLocaleTimeString('en-GB', { hour: '2-digit', minute: '2-digit' });
  return isToday
    ? time
    : `${date.toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' })}, ${time}`;
}

export function formatDims(dims: readonly number[]): string {
  return dims.join(' \u00d7 ');
}

export function formatSpacing(spacing: readonly number[]): string {
  return `${spacing.map((value) => formatNumber(value, 3)).join(' \u00d7 ')} mm`;
}

export function shortId(id: string): string {
  return id.length > 12 ? id.slice(-8) : id;
}

export function meshFormatTitle(name: string): string {
  return meshFormatTitles[name] ?? name;
}

// The end of a mesh file's name, without the dot.
export function meshFileSuffix(name: string): string {
  return meshFileSuffixes[name] ?? name;
}

export function volumeFormatTitle(name: string): string {
  return volumeFormats.find((format) => format.name === name)?.title ?? name;
}

// Three digits that count, so that neighbours in a table are as long.
export function millimetres(value: number): string {
  if (value === 0) return '0';
  if (value < 0.0005) return '< 0.001';
  return value.toFixed(Math.max(0, Math.min(3, 2 - Math.floor(Math.log10(value)))));
}
