// The box of a crop in a slice: seen, and moved by its edges.
import type { Vec3 } from '../../api/types';
import type { Box } from '../../volume/crop';
import { SliceGrip, type Spot } from './slice_grip';

export interface CropHost {
  // Null while nothing is cropped.
  box: () => Box | null;
  setBox: (box: Box) => void;
}

type AxisNumber = 0 | 1 | 2;

// Along the picture's columns and rows, which end of the box; null for neither.
type Ends = [0 | 1 | null, 0 | 1 | null];

const reachOfMouse = 7;
const reachOfTouch = 18;

export class SliceCrop {
  readonly grip = new SliceGrip<Ends>((spot) => this.endsAt(spot), (ends, place) => this.drag(ends, place));

  constructor(
    private readonly host: CropHost,
    // The picture's columns and rows.
    private readonly axes: [AxisNumber, AxisNumber],
  ) {}

  // Over the slice, in its samples.
  paint(context: CanvasRenderingContext2D): boolean {
    const box = this.host.box();
    if (!box) return false;
    const [low, high] = box;
    const [column, row] = this.axes;
    context.beginPath();
    context.rect(low[column], low[row], high[column] - low[column], high[row] - low[row]);
    return true;
  }

  // Which edges are at that place.
  private endsAt({ place, pixels, isTouch }: Spot): Ends | null {
    const box = this.host.box();
    if (!box) return null;
    const reach = isTouch ? reachOfTouch : reachOfMouse;
    const near = (along: 0 | 1, end: 0 | 1): boolean => {
      const across = along === 0 ? 1 : 0;
      const [axis, other] = [this.axes[along], this.axes[across]];
      const slack = reach / pixels[across];
      const isBeside = place[across] > box[0][other] - slack && place[across] < box[1][other] + slack;
      return isBeside && Math.abs(place[along] - box[end][axis]) * pixels[along] < reach;
    };
    const endOf = (along: 0 | 1): 0 | 1 | null => (near(along, 0) ? 0 : near(along, 1) ? 1 : null);
    const ends: Ends = [endOf(0), endOf(1)];
    return ends.every((end) => end === null) ? null : ends;
  }

  private drag(ends: Ends, place: Spot['place']): void {
    const box = this.host.box();
    if (!box) return;
    const next: Box = [[...box[0]], [...box[1]]];
    ([0, 1] as const).forEach((along) => {
      const end = ends[along];
      if (end === null) return;
      const axis = this.axes[along];
      const value = Math.round(place[along]);
      const other: Vec3 = box[end === 0 ? 1 : 0];
      next[end][axis] = end === 0 ? Math.min(value, other[axis] - 1) : Math.max(value, other[axis] + 1);
    });
    this.host.setBox(next);
  }
}
