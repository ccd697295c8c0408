// Enlarges and moves a slice: by the wheel with Ctrl or a pinch, by dragging with Shift or the middle button, by keys.
import { button } from '../../ui/dom';
import type { Scope } from '../../ui/signal';
import { wheelZoom } from '../../ui/wheel';
import { Zoom } from '../../volume/zoom';

const keyFactor = 1.25;
const keyShift = 0.1;

export class SliceZoom {
  readonly zoom = new Zoom();
  // How much it is enlarged; takes it back.
  readonly element: HTMLButtonElement;
  // Fingers and buttons that move or enlarge it now, by their pointers.
  private readonly held = new Map<number, { x: number; y: number }>();

  constructor(
    private readonly canvas: HTMLCanvasElement,
    scope: Scope,
    private readonly onChange: () => void,
  ) {
    const reset = (): void => {
      this.zoom.reset();
      this.changed();
    };
    this.element = button('', reset, { class: 'slice-zoom', hidden: true, title: 'Show the whole slice (0)' });
    scope.listen(canvas, 'pointerdown', (event: PointerEvent) => this.begin(event));
    scope.listen(canvas, 'pointermove', (event: PointerEvent) => this.move(event));
    for (const name of ['pointerup', 'pointercancel'] as const) {
      scope.listen(canvas, name, (event: PointerEvent) => {
        this.held.delete(event.pointerId);
      });
    }
    scope.listen(canvas, 'keydown', (event: KeyboardEvent) => this.key(event));
  }

  // True if this pointer, or two fingers, move the picture.
  isMoving(event: PointerEvent): boolean {
    return event.pointerType === 'touch' ? this.held.size > 1 : this.held.has(event.pointerId);
  }

  wheel(event: WheelEvent): void {
    this.zoom.by(wheelZoom(event), this.partOf(event));
    this.changed();
  }

  private partOf({ clientX, clientY }: { clientX: number; clientY: number }): { x: number; y: number } {
    const box = this.canvas.getBoundingClientRect();
    return { x: (clientX - box.left) / (box.width || 1), y: (clientY - box.top) / (box.height || 1) };
  }

  private begin(event: PointerEvent): void {
    const isPan = event.button === 1 || (event.button === 0 && event.shiftKey);
    if (event.pointerType !== 'touch' && !isPan) return;
    if (event.button === 1) event.preventDefault();
    this.canvas.setPointerCapture(event.pointerId);
    this.held.set(event.pointerId, this.partOf(event));
  }

  private move(event: PointerEvent): void {
    const before = this.held.get(event.pointerId);
    if (!before) return;
    const now = this.partOf(event);
    this.held.set(event.pointerId, now);
    if (!this.isMoving(event)) return;
    const other = [...this.held].find(([id]) => id !== event.pointerId)?.[1];
    const share = other ? 0.5 : 1;
    this.zoom.pan(share * (now.x - before.x), share * (now.y - before.y));
    if (other) {
      const apart = (from: { x: number; y: number }): number => Math.hypot(from.x - other.x, from.y - other.y) || 1;
      this.zoom.by(apart(now) / apart(before), { x: (now.x + other.x) / 2, y: (now.y + other.y) / 2 });
    }
    this.changed();
  }

  private key(event: KeyboardEvent): void {
    const { key } = event;
    const arrows: Record<string, [number, number]> = {
      ArrowLeft: [keyShift, 0],
      ArrowRight: [-keyShift, 0],
      ArrowUp: [0, keyShift],
      ArrowDown: [0, -keyShift],
    };
    const arrow = arrows[key];
    if ((event.ctrlKey || event.metaKey) && arrow) this.zoom.pan(...arrow);
    else if (event.ctrlKey || event.metaKey || event.altKey) return;
    else if (key === '+' || key === '=') this.zoom.by(keyFactor);
    else if (key === '-') this.zoom.by(1 / keyFactor);
    else if (key === '0') this.zoom.reset();
    else return;
    event.preventDefault();
    this.changed();
  }

  private changed(): void {
    const { scale } = this.zoom;
    this.element.hidden = scale === 1;
    this.element.textContent = `${scale.toFixed(1)} \u00d7`;
    this.element.setAttribute('aria-label', `Enlarged ${scale.toFixed(1)} times; show the whole slice`);
    this.onChange();
  }
}
