// The histogram with the iso-value as a line to drag.
import { h, svg } from '../../ui/dom';
import { formatValue, shortened } from '../../ui/format';
import type { Scope } from '../../ui/signal';
import { barHeights, binWidth, niceStep, quantile, ticks, type Histogram } from '../../volume/histogram';
import type { Window } from '../../volume/slices';

const width = 320;
const height = 96;
const baseline = 82;

export class HistogramView {
  readonly element: HTMLElement;
  private readonly line = svg('line.iso-line', { y1: 0, y2: baseline });
  private readonly grip = h('span.iso-grip');
  private readonly band = svg('rect.window-band', { y: 0, height: baseline });
  private readonly thumb: HTMLElement;
  // The visible range. It leaves out outliers where they make most of the range.
  private readonly low: number;
  private readonly high: number;
  private readonly step: number;
  private iso = 0;

  constructor(
    histogram: Histogram,
    isInteger: boolean,
    private readonly onIso: (iso: number) => void,
    private readonly scope: Scope,
  ) {
    const margin = binWidth(histogram);
    const [least, greatest] = histogram.range;
    const [low, high] = [Math.max(least, quantile(histogram, 0.0002) - margin), Math.min(greatest, quantile(histogram, 0.9998) + margin)];
    const isMostly = 2 * (high - low) > greatest - least;
    this.low = isMostly ? least : low;
    this.high = isMostly ? greatest : high;
    if (!(this.high > this.low)) this.high = this.low + 1;
    this.step = niceStep([this.low, this.high], isInteger);
    const marks = ticks([this.low, this.high], 5);
    this.thumb = h('div.histogram', {
      role: 'slider',
      tabindex: '0',
      'aria-label': 'Iso-value',
      'aria-valuemin': this.low,
      'aria-valuemax': this.high,
    });
    this.thumb.append(
      svg('svg', { viewBox: `0 0 ${width} ${height}`, preserveAspectRatio: 'none', 'aria-hidden': 'true' }, [
        this.band,
        svg('path.bars', { d: this.outline(histogram) }),
        svg('line.axis', { x1: 0, x2: width, y1: baseline, y2: baseline }),
        ...marks.map((value) =>
          svg('line.axis', {
            x1: this.toX(value),
            x2: this.toX(value),
            y1: baseline,
            y2: baseline + 4,
          }),
        ),
        this.line,
      ]),
      this.grip,
      h('div.ticks', { 'aria-hidden': 'true' }, [
        ...marks.map((value) => {
          const label = h('span', formatValue(value, this.high - this.low));
          label.style.left = `${(100 * this.toX(value)) / width}%`;
          return label;
        }),
      ]),
    );
    this.element = this.thumb;
    this.listen();
  }

  // The values that are shown.
  get shown(): Window {
    return [this.low, this.high];
  }

  show(iso: number, window: Window): void {
    this.iso = iso;
    const x = Math.max(0, Math.min(width, this.toX(iso)));
    this.line.setAttribute('x1', String(x));
    this.line.setAttribute('x2', String(x));
    this.grip.style.left = `${(100 * x) / width}%`;
    const left = Math.max(0, Math.min(width, this.toX(window[0])));
    const right = Math.max(0, Math.min(width, this.toX(window[1])));
    this.band.setAttribute('x', String(left));
    this.band.setAttribute('width', String(Math.max(0, right - left)));
    this.thumb.setAttribute('aria-valuenow', String(iso));
    this.thumb.setAttribute('aria-valuetext', `iso-value ${formatValue(iso, this.high - this.low)}`);
  }

  private toX(value: number): number {
    return (width * (value - this.low)) / (this.high - this.low);
  }

  private outline(histogram: Histogram): string {
    const heights = barHeights(histogram.counts);
    const step = binWidth(histogram);
    let path = `M0 ${baseline}`;
    heights.forEach((part, bin) => {
      const begin = histogram.range[0] + bin * step;
      if (begin + step < this.low || begin > this.high) return;
      const y = (baseline - part * (baseline - 8)).toFixed(1);
      const x0 = Math.max(0, this.toX(begin)).toFixed(2);
      const x1 = Math.min(width, this.toX(begin + step)).toFixed(2);
      path += `L${x0} ${y}L${x1} ${y}`;
    });
    return `${path}L${width} ${baseline}Z`;
  }

  private rounded(value: number): number {
    const whole = Math.round(value / this.step) * this.step;
    return shortened(Math.max(this.low, Math.min(this.high, whole)), this.high - this.low, 9);
  }

  private listen(): void {
    const { thumb, scope } = this;
    const take = (event: PointerEvent): void => {
      const box = thumb.getBoundingClientRect();
      const part = (event.clientX - box.left) / (box.width || 1);
      this.onIso(this.rounded(this.low + part * (this.high - this.low)));
    };
    scope.listen(thumb, 'pointerdown', (event: PointerEvent) => {
      if (event.button !== 0 || !event.isPrimary) return;
      thumb.setPointerCapture(event.pointerId);
      thumb.focus();
      take(event);
      event.preventDefault();
    });
    scope.listen(thumb, 'pointermove', (event: PointerEvent) => {
      if (thumb.hasPointerCapture(event.pointerId)) take(event);
    });
    scope.listen(thumb, 'keydown', (event: KeyboardEvent) => {
      const page = (this.high - this.low) / 20;
      const moves: Record<string, number> = {
        ArrowLeft: -this.step,
        ArrowDown: -this.step,
        ArrowRight: this.step,
        ArrowUp: this.step,
        PageDown: -page,
        PageUp: page,
      };
      const move = moves[event.key];
      if (move !== undefined) this.onIso(this.rounded(this.iso + (event.shiftKey ? 10 : 1) * move));
      else if (event.key === 'Home') this.onIso(this.low);
      else if (event.key === 'End') this.onIso(this.high);
      else return;
      event.preventDefault();
    });
  }
}
