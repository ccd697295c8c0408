interface Kept<T> {
  wanted: Promise<T>;
  // Null until it is here.
  made: T | null;
}

// Keeps what was fetched lately.
export class Nearby<T> {
  // The oldest first.
  private readonly kept = new Map<string, Kept<T>>();

  constructor(private readonly most: number) {}

  // Null unless it is here already.
  find(key: string): T | null {
    return this.kept.get(key)?.made ?? null;
  }

  get(key: string, make: () => Promise<T>): Promise<T> {
    const entry = this.kept.get(key) ?? this.begin(key, make);
    this.kept.delete(key);
    this.kept.set(key, entry);
    for (const oldest of this.kept.keys()) {
      if (this.kept.size <= this.most) break;
      this.kept.delete(oldest);
    }
    return entry.wanted;
  }

  // An answer goes into its own entry, so nothing is kept after its entry has left.
  private begin(key: string, make: () => Promise<T>): Kept<T> {
    const entry: Kept<T> = { wanted: make(), made: null };
    entry.wanted.then(
      (made) => (entry.made = made),
      () => this.kept.get(key) === entry && this.kept.delete(key),
    );
    return entry;
  }
}
