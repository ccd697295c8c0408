// Small charts of a job's numbers.
import { stages as order } from '../../../generated/parameters';
import type { Distribution, QualityStages } from '../../api/types';
import type { Change } from '../../job/changes';
import { h, svg } from '../../ui/dom';
import { formatMilliseconds, formatNumber } from '../../ui/format';

// In milliseconds, by stage.
export type Durations = Readonly<Record<string, number>>;

export interface Step {
  name: string;
  begin: number;
  duration: number;
}

// The stages that ran, one after the other; members that this page does not know come at the end.
export function stepsOf(timing: Durations, more: Durations = {}): Step[] {
  const known = order.filter((name) => (timing[name] ?? 0) > 0);
  const others = Object.keys(timing).filter((name) => !order.includes(name) && name !== 'total');
  let begin = 0;
  return [
    ...[...known, ...others].map((name) => ({ name, duration: timing[name] ?? 0 })),
    ...Object.entries(more).map(([name, duration]) => ({ name, duration })),
  ].map(({ name, duration }) => {
    const step = { name, begin, duration };
    begin += duration;
    return step;
  });
}

// The time of a job, and of what came after it. A job that failed or was cancelled has taken more time than its
// stages, since the one that it was in is not among them.
export function totalOf(timing: Durations, more: Durations = {}): number {
  const sum = (durations: readonly number[]): number => durations.reduce((all, duration) => all + duration, 0);
  const stages = sum(stepsOf(timing).map(({ duration }) => duration));
  return (timing['total'] ?? stages) + sum(Object.values(more));
}

export function waterfall(steps: readonly Step[], total: number): HTMLElement {
  const all = Math.max(total, ...steps.map(({ begin, duration }) => begin + duration)) || 1;
  return h('table.waterfall', [
    h('caption.sr-only', 'Time of each stage'),
    ...steps.map(({ name, begin, duration }) => {
      const bar = h('span', { class: `bar of-${name}` });
      bar.style.marginLeft = `${(100 * begin) / all}%`;
      bar.style.width = `${Math.max(0.6, (100 * duration) / all)}%`;
      return h('tr', [
        h('th', { scope: 'row' }, name),
        h('td.track', bar),
        h('td.number', formatMilliseconds(duration)),
      ]);
    }),
    h('tr.total', [
      h('th', { scope: 'row' }, 'total'),
      h('td'),
      h('td.number', formatMilliseconds(total)),
    ]),
  ]);
}

// The outline of bars that fill the width, whose heights are these shares of the height.
export function stepsPath(shares: readonly number[], width: number, height: number): string {
  const step = width / Math.max(1, shares.length);
  const parts = shares.map((share, bin) => {
    const y = (height - share * (height - 2)).toFixed(1);
    return `L${(bin * step).toFixed(1)} ${y}L${((bin + 1) * step).toFixed(1)} ${y}`;
  });
  return `M0 ${height}${parts.join('')}L${width.toFixed(1)} ${height}Z`;
}

const width = 150;
const height = 44;

// Both distributions in one picture: before the change as an outline, after it filled.
export function distributionChart(
  title: string,
  stages: QualityStages,
  most: number,
  unit: string,
  change: Change | null,
): HTMLElement {
  const { extracted, smoothed } = stages;
  const top = Math.max(1, ...extracted.histogram, ...smoothed.histogram);
  const outline = ({ histogram }: Distribution): string => stepsPath(histogram.map((count) => count / top), width, height);
  const digits = most > 1 ? 1 : 3;
  const said = (value: number): string => {
    const isTiny = value > 0 && value < 10 ** -digits;
    return `${isTiny ? `< ${10 ** -digits}` : formatNumber(value, digits)}${unit}`;
  };
  return h('figure.distribution', [
    svg('svg', {
      viewBox: `0 0 ${width} ${height}`,
      role: 'img',
      'aria-label': `${title}: mean ${change ? `${said(extracted.mean)} ${change.before} and ${said(smoothed.mean)} ${change.after}` : said(smoothed.mean)}`,
    }, [
      svg('path.after', { d: outline(smoothed) }),
      ...(change ? [svg('path.before', { d: outline(extracted) })] : []),
    ]),
    h('div.distribution-axis', { 'aria-hidden': 'true' }, h('span', `0${unit}`), h('span', `${most}${unit}`)),
    h('figcaption', [
      h('b', title),
      ` mean ${change ? `${said(extracted.mean)} \u2192 ` : ''}${said(smoothed.mean)}, minimum ${said(smoothed.min)}`,
    ]),
  ]);
}
