// An answer that is asked for once. After a failure the next call asks again.
export class Once<T> {
  private key: string | null = null;
  private made: Promise<T> | null = null;

  // Another key asks anew.
  get(key: string, make: () => Promise<T>): Promise<T> {
    if (this.made && this.key === key) return this.made;
    const made = make();
    this.key = key;
    this.made = made;
    made.catch(() => {
      if (this.made === made) this.made = null;
    });
    return made;
  }
}
