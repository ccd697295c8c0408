// Clicks and taps: presses that are let go where they began, with no second finger there meanwhile.
const reach: Record<string, number> = { touch: 12, pen: 8 };
const reachOfMouse = 4;

export function onTap(element: HTMLElement, handler: (event: PointerEvent) => void): void {
  const down = new Set<number>();
  let press: { x: number; y: number } | null = null;
  element.addEventListener('pointerdown', (event) => {
    down.add(event.pointerId);
    press = down.size === 1 ? { x: event.clientX, y: event.clientY } : null;
  });
  element.addEventListener('pointermove', (event) => {
    if (!press) return;
    const most = reach[event.pointerType] ?? reachOfMouse;
    if (Math.hypot(event.clientX - press.x, event.clientY - press.y) > most) press = null;
  });
  element.addEventListener('pointerup', (event) => {
    down.delete(event.pointerId);
    const isTap = press !== null && down.size === 0;
    press = null;
    if (isTap) handler(event);
  });
  element.addEventListener('pointercancel', (event) => {
    down.delete(event.pointerId);
    press = null;
  });
}
