import { describe, expect, it } from 'vitest';
import { defaultStyle } from '@/scene/style';
import { History } from '@/ui/history';
import { labelsOfText, rulersOfText, rulersToText, styleOfText, styleToText } from '@/views/surface/look_text';

describe('a look in the address', () => {
  it('is a style and back, of which only what is not as usual is said', () => {
    expect(styleToText(defaultStyle)).toBe('');
    expect(styleOfText('')).toEqual(defaultStyle);
    const style = { shading: 'flat' as const, wireframe: true, opacity: 0.35, distance: true };
    expect(styleToText(style)).toBe('flat,wires,distance,opacity-35');
    expect(styleOfText(styleToText(style))).toEqual(style);
    expect(styleOfText('opacity-900,nonsense,flat')).toEqual({ ...defaultStyle, shading: 'flat' });
  });

  it('has rulers to a hundredth of a millimetre', () => {
    const text = rulersToText([
      { from: [1.2345678, -2, 3], to: [4, 5, 0.0351234] },
      { from: [0, 0, 0], to: [0, 0, 1] },
    ]);
    expect(text).toBe('1.23457,-2,3,4,5,0.0351234;0,0,0,0,0,1');
    expect(rulersOfText(text)).toEqual([
      { from: [1.23457, -2, 3], to: [4, 5, 0.0351234] },
      { from: [0, 0, 0], to: [0, 0, 1] },
    ]);
    expect(rulersOfText(';1,2,3;1,2,3,4,5,x')).toEqual([]);
  });

  it('has labels', () => {
    expect(labelsOfText('1,-2,x,,30')).toEqual(new Set([1, -2, 30]));
  });
});

describe('what was changed', () => {
  it('takes a drag as one change, however long it rests', () => {
    const { history: one, wait } = history();
    one.change(1);
    one.hold();
    for (const value of [2, 3, 4]) {
      wait(5000);
      one.change(value);
    }
    one.release();
    one.change(5);
    expect([one.undo(), one.undo(), one.undo(), one.undo()]).toEqual([4, 1, 0, null]);
  });

  function history(): { history: History<number>; wait: (time: number) => void } {
    let now = 0;
    return { history: new History(0, () => now), wait: (time) => (now += time) };
  }

  it('is taken back and done again', () => {
    const { history: changes, wait } = history();
    expect([changes.undo(), changes.redo()]).toEqual([null, null]);
    for (const value of [1, 2, 2, 3]) {
      changes.change(value);
      wait(1000);
    }
    expect([changes.undo(), changes.undo(), changes.redo(), changes.undo(), changes.undo(), changes.undo()]).toEqual([2, 1, 2, 1, 0, null]);
    changes.change(7);
    expect([changes.canRedo, changes.undo(), changes.redo()]).toEqual([false, 0, 7]);
  });

  it('at once is one change', () => {
    const { history: changes, wait } = history();
    for (let value = 1; value < 50; value += 1) {
      changes.change(value);
      wait(30);
    }
    wait(1000);
    changes.change(99);
    expect([changes.undo(), changes.undo(), changes.canUndo]).toEqual([49, 0, false]);
  });
});
