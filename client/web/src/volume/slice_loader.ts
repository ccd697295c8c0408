// Brings the slice that is wanted: one request at a time, of which the next is for what is wanted last.
import { onReconnect } from '../client';
import { delayAfter } from '../api/busy';
import { asApiError, mayPass, type ApiError } from '../api/problem';
import type { Axis } from '../api/types';
import type { Scope } from '../ui/signal';
import type { LabelMap } from './label_map';
import { sliceKey, type Slice, type SliceSource, type Window } from './slices';

export interface SliceLoaderHost {
  // Something is to be drawn anew.
  onChange: () => void;
  // The daemon will not give it.
  onRefused: (error: ApiError) => void;
}

interface Wanted {
  key: string;
  index: number;
  window: Window;
  map: LabelMap | null;
}

// Sooner nobody notices that a slice is not there yet.
const lateAfter = 250;
const retryDelays = [1000, 2000, 4000, 8000];

export class SliceLoader {
  // The one that is wanted, or the last one that was there; null also when the one that is wanted failed.
  slice: Slice | null = null;
  // Of the slice that is wanted.
  error: ApiError | null = null;
  isLate = false;
  private wanted: Wanted | null = null;
  private isBusy = false;
  private failures = 0;
  private retry = 0;
  private late = 0;

  constructor(
    private readonly source: Pick<SliceSource, 'find' | 'get'>,
    private readonly axis: Axis,
    private readonly scope: Scope,
    private readonly host: SliceLoaderHost,
  ) {
    onReconnect(scope, () => this.error?.isUnreachable && this.load());
    scope.onEnd(() => {
      clearTimeout(this.retry);
      clearTimeout(this.late);
    });
  }

  want(index: number, window: Window, map: LabelMap | null = null): void {
    const key = sliceKey(this.axis, index, window, map);
    if (key === this.wanted?.key) return;
    this.wanted = { key, index, window, map };
    this.error = null;
    this.failures = 0;
    clearTimeout(this.retry);
    this.load();
  }

  private load(): void {
    const { wanted } = this;
    if (!wanted || this.scope.isOver) return;
    const found = this.source.find(this.axis, wanted.index, wanted.window, wanted.map);
    if (found) this.show(found);
    else if (!this.isBusy) void this.fetch(wanted);
    if (!found && this.late === 0) {
      this.late = window.setTimeout(() => {
        this.isLate = this.slice?.index !== this.wanted?.index;
        this.host.onChange();
      }, lateAfter);
    }
  }

  private async fetch(wanted: Wanted): Promise<void> {
    this.isBusy = true;
    let slice: Slice | null = null;
    let error: ApiError | null = null;
    try {
      slice = await this.source.get(this.axis, wanted.index, wanted.window, wanted.map);
    } catch (caught) {
      error = asApiError(caught);
    }
    this.isBusy = false;
    if (this.scope.isOver) return;
    const isWanted = this.wanted?.key === wanted.key;
    // One on the way to what is wanted is nearer than the one before.
    if (slice) this.show(slice);
    else if (error && isWanted) this.fail(error);
    if (!isWanted) this.load();
  }

  private show(slice: Slice): void {
    this.slice = slice;
    if (slice.index === this.wanted?.index) {
      clearTimeout(this.late);
      this.late = 0;
      this.isLate = false;
      this.error = null;
      this.failures = 0;
    }
    this.host.onChange();
  }

  private fail(error: ApiError): void {
    // The same slice over another window is still the slice.
    if (this.slice?.index !== this.wanted?.index) {
      this.slice = null;
      this.error = error;
    }
    this.host.onChange();
    if (!mayPass(error)) {
      this.host.onRefused(error);
    } else {
      const delay = retryDelays[Math.min(this.failures, retryDelays.length - 1)] ?? 0;
      this.failures += 1;
      this.retry = window.setTimeout(() => this.load(), delayAfter(error, delay));
    }
  }
}
