// Brings the slice that is wanted and, while somebody steps through slices, those ahead.
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
// A browser has six connections to a server, for all planes. Without steps, only the last wish counts.
const mostRequests = { atRest: 1, stepping: 4 };
const mostAhead = 8;
// A longer way is a jump, which does not tell where the next one goes.
const longestStep = 5;

export class SliceLoader {
  // The one that is wanted, or the last one that was there; null also when the one that is wanted failed.
  slice: Slice | null = null;
  // Of the slice that is wanted.
  error: ApiError | null = null;
  isLate = false;
  private wanted: Wanted | null = null;
  // 1 and -1 while somebody steps up and down.
  private direction = 0;
  private readonly requested = new Set<string>();
  private failures = 0;
  private retry = 0;
  private late = 0;

  constructor(
    private readonly source: Pick<SliceSource, 'find' | 'get'>,
    private readonly axis: Axis,
    private readonly count: number,
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
    const step = index - (this.wanted?.index ?? index);
    const direction = Math.abs(step) <= longestStep ? Math.sign(step) : 0;
    // Nothing waits for slices that lie ahead on another way.
    if (direction !== this.direction) this.requested.clear();
    this.direction = direction;
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
    else this.fetch(wanted);
    this.fetchAhead(wanted);
    if (!found && this.late === 0) {
      this.late = window.setTimeout(() => {
        this.isLate = this.slice?.index !== this.wanted?.index;
        this.host.onChange();
      }, lateAfter);
    }
  }

  private fetchAhead({ index: from, window, map }: Wanted): void {
    for (let ahead = 1; this.direction !== 0 && ahead <= mostAhead; ahead += 1) {
      const index = from + ahead * this.direction;
      if (index < 0 || index >= this.count) return;
      if (this.source.find(this.axis, index, window, map)) continue;
      this.fetch({ key: sliceKey(this.axis, index, window, map), index, window, map });
    }
  }

  // Does nothing if that many requests are under way that this one has to wait.
  private fetch(wanted: Wanted): void {
    const most = this.direction === 0 ? mostRequests.atRest : mostRequests.stepping;
    if (this.requested.size >= most || this.requested.has(wanted.key)) return;
    this.requested.add(wanted.key);
    void this.source.get(this.axis, wanted.index, wanted.window, wanted.map).then(
      (slice) => this.settle(wanted, slice, null),
      (error: unknown) => this.settle(wanted, null, asApiError(error)),
    );
  }

  private settle({ key, index }: Wanted, slice: Slice | null, error: ApiError | null): void {
    this.requested.delete(key);
    if (this.scope.isOver) return;
    const isWanted = this.wanted?.key === key;
    const distance = (from: number | undefined): number => Math.abs((from ?? Infinity) - (this.wanted?.index ?? 0));
    // One on the way to what is wanted is shown until that is there.
    if (slice && (isWanted || distance(index) < distance(this.slice?.index))) this.show(slice);
    else if (error) this.direction = 0;
    if (error && isWanted) this.fail(error);
    else if (!isWanted || this.direction !== 0) this.load();
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
