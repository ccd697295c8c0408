// How far a slice is enlarged, and what of it is seen.
import type { Placement } from './geometry';

const most = 24;

export class Zoom {
  scale = 1;
  // Of the picture's middle from the canvas's, in parts of the canvas.
  private x = 0;
  private y = 0;

  // Where the picture lies on a canvas of that size, of where it lies as a whole.
  placed([a, b, c, d, e, f]: Placement, width: number, height: number): Placement {
    const { scale, x, y } = this;
    const along = (at: number, size: number, shift: number): number => (at - size / 2) * scale + size / 2 + shift * size;
    return [a * scale, b * scale, c * scale, d * scale, along(e, width, x), along(f, height, y)];
  }

  // Nearer or farther by that factor; the point, in parts of the canvas, stays where it is.
  by(factor: number, point: { x: number; y: number } = { x: 0.5, y: 0.5 }): void {
    const next = Math.max(1, Math.min(most, this.scale * factor));
    const ratio = next / this.scale;
    this.scale = next;
    this.x = (this.x - (point.x - 0.5)) * ratio + (point.x - 0.5);
    this.y = (this.y - (point.y - 0.5)) * ratio + (point.y - 0.5);
    this.pan(0, 0);
  }

  // In parts of the canvas. What is seen never leaves the picture.
  pan(x: number, y: number): void {
    const limit = (this.scale - 1) / 2;
    const within = (value: number): number => Math.max(-limit, Math.min(limit, value));
    this.x = within(this.x + x);
    this.y = within(this.y + y);
  }

  reset(): void {
    this.scale = 1;
    this.x = 0;
    this.y = 0;
  }
}
