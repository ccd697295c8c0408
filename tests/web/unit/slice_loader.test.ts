import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { ApiError, unreachable } from '@/api/problem';
import { connected } from '@/client';
import { Scope } from '@/ui/signal';
import { SliceLoader } from '@/volume/slice_loader';
import type { Slice, Window } from '@/volume/slices';

const window: Window = [0, 100];

interface Asked {
  index: number;
  answer: (error?: Error) => void;
}

// A source that answers when the test says so.
class Source {
  readonly asked: Asked[] = [];
  private readonly made = new Map<number, Slice>();
  find(_axis: 'x' | 'y' | 'z', index: number): Slice | null {
    return this.made.get(index) ?? null;
  }
  get(axis: 'x' | 'y' | 'z', index: number): Promise<Slice> {
    return new Promise((resolve, reject) => {
      this.asked.push({
        index,
        answer: (error) => {
          if (error) reject(error);
          else {
            const slice = { axis, index, window, width: 1, height: 1, values: new Uint8Array(1) };
            this.made.set(index, slice);
            resolve(slice);
          }
        },
      });
    });
  }
}

function loader(): { source: Source; made: SliceLoader; refused: ApiError[]; scope: Scope } {
  const source = new Source();
  const scope = new Scope();
  const refused: ApiError[] = [];
  const made = new SliceLoader(source, 'z', 200, scope, { onChange: () => undefined, onRefused: (error) => refused.push(error) });
  return { source, made, refused, scope };
}

const settle = (): Promise<unknown> => vi.advanceTimersByTimeAsync(0);

describe('slices that are wanted one after the other', () => {
  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal('window', globalThis);
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
    connected.value = true;
  });

  it('are asked for one at a time after jumps, the last one next', async () => {
    const { source, made } = loader();
    for (let index = 0; index < 180; index += 20) made.want(index, window);
    expect(source.asked.map(({ index }) => index)).toEqual([0]);
    source.asked[0]?.answer();
    await settle();
    expect(source.asked.map(({ index }) => index)).toEqual([0, 160]);
    source.asked[1]?.answer();
    await settle();
    expect(made.slice?.index).toBe(160);
    expect(source.asked).toHaveLength(2);
  });

  it('are fetched ahead, so that most are seen behind a slow network', async () => {
    const { source, made } = loader();
    const get = source.get.bind(source);
    source.get = (axis, index) => {
      const slice = get(axis, index);
      const { answer } = source.asked.at(-1) as Asked;
      setTimeout(answer, 300);
      return slice;
    };
    let seen = 0;
    for (let index = 50; index < 90; index += 1) {
      made.want(index, window);
      await vi.advanceTimersByTimeAsync(100);
      if (made.slice?.index === index) seen += 1;
    }
    expect(seen).toBeGreaterThan(30);
    // Those ahead are there already, and no more.
    await vi.advanceTimersByTimeAsync(5000);
    expect(Math.max(...source.asked.map(({ index }) => index))).toBe(97);
    expect(new Set(source.asked.map(({ index }) => index)).size).toBe(source.asked.length);
  });

  it('are wanted the other way, or elsewhere, without waiting for those ahead', async () => {
    const { source, made } = loader();
    for (const index of [10, 11, 12]) made.want(index, window);
    made.want(150, window);
    expect(source.asked.at(-1)?.index).toBe(150);
    source.asked.at(-1)?.answer();
    await settle();
    expect(made.slice?.index).toBe(150);
  });

  it('are not another slice when they fail, and are asked for again', async () => {
    const { source, made, refused } = loader();
    made.want(3, window);
    source.asked[0]?.answer();
    await settle();
    made.want(70, window);
    source.asked[1]?.answer(unreachable());
    await settle();
    expect(made.slice).toBeNull();
    expect(made.error?.isUnreachable).toBe(true);
    // Somebody answers again.
    connected.value = false;
    connected.value = true;
    source.asked[2]?.answer();
    await settle();
    expect(made.slice?.index).toBe(70);
    expect(made.error).toBeNull();
    expect(refused).toEqual([]);
  });

  it('are asked for again by and by, but not when they are gone', async () => {
    const { source, made, refused } = loader();
    made.want(3, window);
    source.asked[0]?.answer(new ApiError(503, 'Busy', ''));
    await settle();
    await vi.advanceTimersByTimeAsync(1100);
    expect(source.asked).toHaveLength(2);
    source.asked[1]?.answer(new ApiError(410, 'Gone', ''));
    await settle();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(source.asked).toHaveLength(2);
    expect(refused.map(({ status }) => status)).toEqual([410]);
  });
});
