// Keeps what was fetched lately.
export class Nearby<T> {
  // The oldest first.
  private readonly kept = new Map<string, Promise<T>>();
  private readonly made = new Map<string, T>();

  constructor(private readonly most: number) {}

  // Null unless it is here already.
  find(key: string): T | null {
    return this.made.get(key) ?? null;
  }

  get(key: string, make: () => Promise<T>): Promise<T> {
    const wanted = this.kept.get(key) ?? make();
    if (!this.kept.has(key)) wanted.then((made) => this.made.set(key, made), () => this.kept.delete(key));
    this.kept.delete(key);
    this.kept.set(key, wanted);
    for (const oldest of this.kept.keys()) {
      if (this.kept.size <= this.most) break;
      this.kept.delete(oldest);
      this.made.delete(oldest);
    }
    return wanted;
  }
}
