// How a histogram is shown and read.
// Samples in bins of equal width over a range of values.
export interface Histogram {
  range: [number, number];
  counts: readonly number[];
}

export function binWidth(histogram: Histogram): number {
  const [low, high] = histogram.range;
  return (high - low) / Math.max(1, histogram.counts.length);
}

// Heights from 0 to 1. Background is often nine tenths of a volume, so that the scale is logarithmic.
export function barHeights(counts: readonly number[]): number[] {
  const top = Math.log1p(counts.reduce((a, b) => Math.max(a, b), 0));
  return counts.map((count) => (top > 0 ? Math.log1p(count) / top : 0));
}

// The value below which that part (0 to 1) of all samples lies.
export function quantile(histogram: Histogram, part: number): number {
  const total = histogram.counts.reduce((a, b) => a + b, 0);
  const [low, high] = histogram.range;
  const width = binWidth(histogram);
  let below = 0;
  for (const [bin, count] of histogram.counts.entries()) {
    if (count > 0 && below + count >= part * total) {
      return low + (bin + (part * total - below) / count) * width;
    }
    below += count;
  }
  return high;
}

// A window that shows most of the volume, stretched so that the iso-value lies in it.
export function defaultWindow(histogram: Histogram, iso: number): [number, number] {
  const low = Math.min(quantile(histogram, 0.005), iso);
  const high = Math.max(quantile(histogram, 0.998), iso);
  if (high > low) return [low, high];
  return [low - 0.5, low + 0.5];
}

export function niceStep(range: [number, number], isInteger: boolean): number {
  const span = range[1] - range[0];
  if (!(span > 0)) return 1;
  const step = 10 ** Math.floor(Math.log10(span / 200));
  return isInteger ? Math.max(1, step) : step;
}

// Round values to write under an axis.
export function ticks([low, high]: [number, number], about: number): number[] {
  const span = high - low;
  if (!(span > 0) || about < 1) return [low];
  const raw = span / about;
  const magnitude = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * magnitude).find((value) => value >= raw) ?? raw;
  const values: number[] = [];
  for (let i = Math.ceil(low / step); i * step <= high + step * 1e-9; i += 1) values.push(i * step);
  return values;
}
