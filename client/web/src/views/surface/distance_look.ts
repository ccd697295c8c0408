// A surface in the colours of its vertices' distances: the switch, the legend, and the value below the
// pointer.
import { cssGradient } from '../../scene/colour_map';
import type { Reach } from '../../scene/distances';
import type { Surface } from '../../scene/surface';
import { button, h, segmented } from '../../ui/dom';
import { millimetres } from '../../ui/format';
import type { Scope } from '../../ui/signal';

// The pointer has to rest so long: among millions of triangles finding its own takes a while.
const restDelay = 60;

type Top = keyof Reach;

export class DistanceLook {
  readonly legend = h('div.legend', { hidden: true, role: 'group', 'aria-label': 'Distance from the scan' });
  readonly toggle: HTMLButtonElement;
  isOn = false;
  private reach: Reach | null = null;
  private top: Top = 'p99';
  private readonly ends = h('div.legend-ends');
  private texts: string[] = [];
  private readonly value = h('output.legend-value');
  private timer = 0;

  constructor(
    scope: Scope,
    private readonly surface: Surface,
    onToggle: () => void,
    private readonly onChange: (isOn: boolean) => void,
  ) {
    this.toggle = button('Distance', onToggle, {
      'aria-pressed': 'false',
      title: 'Colour the surface by its distance from the scan, which is measured first if need be (d)',
      'data-tool': 'distance',
    });
    const bar = h('div.legend-bar', { 'aria-hidden': 'true' });
    bar.style.backgroundImage = cssGradient();
    const tops = [
      { value: 'p99', label: '99 %', title: 'The colours end at the 99th percentile of the distances' },
      { value: 'most', label: 'Largest', title: 'The colours end at the largest distance' },
    ] as const;
    this.legend.append(
      segmented<Top>('Distance from the scan', tops, this.top, (top) => {
        this.top = top;
        this.scale();
      }),
      bar,
      this.ends,
      this.value,
    );
    scope.listen(surface.canvas, 'pointermove', (event: PointerEvent) => this.moved(event));
    scope.listen(surface.canvas, 'pointerleave', () => this.tell(null));
    scope.onEnd(() => clearTimeout(this.timer));
  }

  // All of the surface is there. Says whether it has distances.
  loaded(): boolean {
    this.reach = this.surface.reach();
    this.scale();
    return this.reach !== null;
  }

  get hasValues(): boolean {
    return this.reach !== null;
  }

  // For a picture; none where no distances are seen.
  get captions(): readonly string[] {
    return this.isOn ? this.texts : [];
  }

  set(isOn: boolean): void {
    if (!this.reach) return;
    this.isOn = isOn;
    this.toggle.setAttribute('aria-pressed', String(isOn));
    this.legend.hidden = !isOn;
    this.tell(null);
    this.onChange(isOn);
  }

  private scale(): void {
    if (!this.reach) return;
    const top = this.reach[this.top];
    this.surface.setDistanceTop(top);
    this.texts = top === 0 ? ['0 mm everywhere'] : ['0', millimetres(top / 2), `${millimetres(top)} mm`];
    if (this.top === 'p99' && top > 0) this.texts[2] += ' or more';
    this.ends.replaceChildren(...this.texts.map((text) => h('span', text)));
  }

  private moved({ clientX, clientY, buttons }: PointerEvent): void {
    clearTimeout(this.timer);
    if (!this.isOn || buttons !== 0) return;
    this.timer = window.setTimeout(() => this.tell(this.surface.below({ clientX, clientY })?.distance ?? null), restDelay);
  }

  private tell(distance: number | null): void {
    clearTimeout(this.timer);
    this.value.textContent = distance === null ? '' : `${millimetres(distance)} mm here`;
  }
}
