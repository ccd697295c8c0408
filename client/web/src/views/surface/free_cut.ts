// A cut at any angle: parallel to the screen as it was when it was turned to the view, and moved along its normal.
import type { Vec3, Volume } from '../../api/types';
import type { Surface } from '../../scene/surface';
import { dot, opposite, toPatient } from '../../volume/geometry';
import type { LabelLook } from '../../volume/label_map';
import { spanOf } from '../../volume/oblique';
import { Once } from '../../volume/once';
import { fetchLabelPreview, fetchPreview, largestPreview } from '../../volume/preview_file';
import type { Preview } from '../../volume/preview';
import { sampledSquare, type Resliced, type Square } from '../../volume/reslice';
import type { Window } from '../../volume/slices';

const pixels = 384;

export class FreeCut {
  // Points to what stays.
  private normal: Vec3 = [0, 1, 0];
  private readonly preview = new Once<Preview>();
  // In millimetres from the volume's middle, along the normal.
  depth = 0;

  constructor(
    private readonly volume: Volume,
    private readonly signal: AbortSignal,
  ) {}

  // Half of its diagonal: no part of it is farther from its middle.
  get reach(): number {
    const far = this.volume.dims.map((count) => count - 0.5) as Vec3;
    return Math.hypot(...toPatient(this.volume, far).map((value, axis) => value - this.middle[axis as 0]));
  }

  private get middle(): Vec3 {
    return toPatient(this.volume, this.volume.dims.map((count) => (count - 1) / 2) as Vec3);
  }

  private get square(): Square {
    const middle = this.middle.map((value, axis) => value + this.depth * this.normal[axis as 0]) as Vec3;
    return { middle, ...spanOf(this.normal), size: 2 * this.reach, pixels };
  }

  // What is nearer to the viewer than the plane goes.
  faceView({ place }: Pick<Surface, 'place'>): void {
    const length = Math.hypot(...place.offset);
    this.normal = place.offset.map((value) => Number((-value / length).toFixed(4))) as Vec3;
  }

  flip(): void {
    this.normal = opposite(this.normal);
    this.depth = -this.depth;
  }

  place(surface: Surface): void {
    surface.cut.placeFreely(this.volume, this.normal, dot(this.square.middle, this.normal), this.square);
  }

  // For the address.
  get text(): string {
    return `f${[...this.normal, Number(this.depth.toPrecision(5))].join(',')}`;
  }

  // False where that is none.
  restore(text: string): boolean {
    const numbers = text.slice(1).split(',').map(Number);
    if (!text.startsWith('f') || numbers.length !== 4 || !numbers.every(Number.isFinite)) return false;
    const [x = 0, y = 0, z = 0, depth = 0] = numbers;
    const length = Math.hypot(x, y, z);
    if (length === 0) return false;
    this.normal = [x / length, y / length, z / length];
    this.depth = Math.max(-this.reach, Math.min(this.reach, depth));
    return true;
  }

  // Labels of larger volumes are not sent as they are.
  get isTooLargeForLabels(): boolean {
    return this.volume.dims.some((count) => count > largestPreview);
  }

  // Over that window, or the numbers of labels.
  async picture(window: Window, look: LabelLook | null): Promise<Resliced> {
    const { signal, volume } = this;
    const preview = await this.preview.get(look ? look.map.key : window.join(), () =>
      look ? fetchLabelPreview(volume.id, look.map, signal) : fetchPreview(volume.id, largestPreview, window, signal),
    );
    return sampledSquare(preview, this.square, look !== null);
  }
}
