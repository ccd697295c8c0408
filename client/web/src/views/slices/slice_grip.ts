// What a pointer can take hold of in a slice, before it moves the slices: edges of a box, a handle.
export interface Spot {
  // From the middle of the picture's first sample, in samples.
  place: [number, number];
  // How many pixels of the screen a sample has along both.
  pixels: [number, number];
  isTouch: boolean;
}

export interface SliceGrip {
  isAt: (spot: Spot) => boolean;
  // True if something was there, which this pointer moves until it lets go.
  hold: (pointer: number, spot: Spot) => boolean;
  // True if this pointer moves it.
  move: (pointer: number, spot: Spot) => boolean;
  letGo: (pointer: number) => boolean;
}
