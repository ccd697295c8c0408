// What a pointer can take hold of in a slice, before it moves the slices: edges of a box, a handle.
export interface Spot {
  // From the middle of the picture's first sample, in samples.
  place: [number, number];
  // How many pixels of the screen a sample has along both.
  pixels: [number, number];
  isTouch: boolean;
}

export class SliceGrip<T> {
  private held: { pointer: number; what: T } | null = null;

  constructor(
    // Null where nothing is.
    private readonly find: (spot: Spot) => T | null,
    private readonly drag: (what: T, place: Spot['place']) => void,
  ) {}

  isAt(spot: Spot): boolean {
    return this.find(spot) !== null;
  }

  // True if something was there, which this pointer moves until it lets go.
  hold(pointer: number, spot: Spot): boolean {
    const what = this.find(spot);
    if (what !== null) this.held = { pointer, what };
    return what !== null;
  }

  // True if this pointer moves it.
  move(pointer: number, { place }: Spot): boolean {
    if (this.held?.pointer !== pointer) return false;
    this.drag(this.held.what, place);
    return true;
  }

  letGo(pointer: number): boolean {
    if (this.held?.pointer !== pointer) return false;
    this.held = null;
    return true;
  }
}
