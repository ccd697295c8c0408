import { describe, expect, it } from 'vitest';
import { looksOfText, looksToText } from '@/views/compare/together_look';

describe('how several surfaces look', () => {
  it('is a text and back', () => {
    const looks = [
      { colour: '#112233', opacity: 0.4, isShown: true },
      { colour: '#abcdef', opacity: 1, isShown: false },
    ];
    expect(looksToText(looks)).toBe('112233.40,abcdef.100-');
    expect(looksOfText(looksToText(looks), [false, false])).toEqual(looks);
  });

  it('is each label\u2019s own colour where there are labels, until somebody says another one', () => {
    const looks = looksOfText('', [true, false]);
    expect(looks.map(({ colour }) => colour)).toEqual(['', '#56b4e9']);
    expect(looksToText(looks)).toBe('own.100,56b4e9.100');
    expect(looksOfText('own.50-,own.100', [true, false])).toEqual([
      { colour: '', opacity: 0.5, isShown: false },
      { colour: '#56b4e9', opacity: 1, isShown: true },
    ]);
    expect(looksOfText('112233.100', [true])).toMatchObject([{ colour: '#112233' }]);
  });

  it('is as usual where nothing is said, or nonsense', () => {
    const usual = looksOfText('', [false, false, false]);
    expect(new Set(usual.map(({ colour }) => colour)).size).toBe(3);
    expect(usual.every(({ opacity, isShown }) => opacity === 1 && isShown)).toBe(true);
    expect(looksOfText('xyz,112233.5,112233.400', [false, false, false])).toMatchObject([usual[0], { opacity: 1 }, { opacity: 1 }]);
  });
});
