// Undo and redo of a user's changes.
const most = 100;
// Changes that follow each other so fast are one: a drag, a number that is typed.
const together = 600;

export class History<T> {
  private readonly past: T[] = [];
  private future: T[] = [];
  private changedAt = -Infinity;
  private isHeld = false;

  constructor(
    private present: T,
    private readonly now: () => number = () => performance.now(),
  ) {}

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  change(next: T): void {
    if (JSON.stringify(next) === JSON.stringify(this.present)) return;
    const now = this.now();
    const isSame = this.isHeld ? this.changedAt > -Infinity : now - this.changedAt <= together;
    if (!isSame || this.past.length === 0) this.past.push(this.present);
    if (this.past.length > most) this.past.shift();
    this.changedAt = now;
    this.future = [];
    this.present = next;
  }

  // Until `release` all changes are one, however long they take: a pointer is down.
  hold(): void {
    this.isHeld = true;
    this.changedAt = -Infinity;
  }

  release(): void {
    this.isHeld = false;
    this.changedAt = -Infinity;
  }

  // Null where there is nothing to take back.
  undo(): T | null {
    const before = this.past.pop();
    if (before === undefined) return null;
    this.future.push(this.present);
    return this.goTo(before);
  }

  redo(): T | null {
    const after = this.future.pop();
    if (after === undefined) return null;
    this.past.push(this.present);
    return this.goTo(after);
  }

  private goTo(state: T): T {
    this.changedAt = -Infinity;
    this.present = state;
    return state;
  }
}
