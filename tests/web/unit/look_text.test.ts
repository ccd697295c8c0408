import { describe, expect, it } from 'vitest';
import { defaultStyle } from '@/scene/style';
import { History } from '@/ui/history';
import { anglesOfText, anglesToText, measuresOfText, measuresToText, slabOfText, slabToText, type Measure } from '@/views/slices/slice_texts';
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

  it('has a slab and the angles of a plane', () => {
    expect([slabToText(null), slabOfText('')]).toEqual(['', null]);
    expect(slabOfText(slabToText({ projection: 'mean', thickness: 20 }))).toEqual({ projection: 'mean', thickness: 20 });
    for (const wrong of ['mean', 'mean-7', 'least-10']) expect(slabOfText(wrong)).toBe(null);
    const text = anglesToText({ turn: Math.PI / 6, tilt: -0.1 });
    expect(text).toBe('30,-5.7');
    expect(anglesToText(anglesOfText(text) ?? { turn: 0, tilt: 0 })).toBe(text);
    for (const wrong of ['', '30', '30,91', '30,x', '1,2,3']) expect(anglesOfText(wrong)).toBe(null);
  });

  it('has the measurements of slices that are whole', () => {
    const length: Measure = { kind: 'length', plane: 'axial', index: 24, points: [[10.5, 24], [30.25, 24]], isWhole: true };
    const area: Measure = { kind: 'area', plane: 'sagittal', index: 3, points: [[0, 0], [4, 0], [4, 3], [0, 3]], isWhole: true };
    const text = measuresToText([length, area, { ...length, points: [[1, 1]], isWhole: false }]);
    expect(text).toBe('length,axial,24,10.5,24,30.25,24;area,sagittal,3,0,0,4,0,4,3,0,3');
    expect(measuresOfText(text)).toEqual([length, area]);
    for (const wrong of ['', 'length,axial,24,1,2', 'length,oblique,24,1,2,3,4', 'area,axial,1,0,0,4,0', 'angle,axial,0.5,1,2,3,4,5,6', 'length,axial,1,1,2,3,x']) {
      expect(measuresOfText(wrong)).toEqual([]);
    }
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
    expect([changes.redo(), changes.undo(), changes.redo()]).toEqual([null, 0, 7]);
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
