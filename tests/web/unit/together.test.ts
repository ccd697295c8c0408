import { describe, expect, it } from 'vitest';
import { looksOfText, looksToText } from '@/views/together_look';

describe('how several surfaces look', () => {
  it('is a text and back', () => {
    const looks = [
      { colour: '#112233', opacity: 0.4, isShown: true },
      { colour: '#abcdef', opacity: 1, isShown: false },
    ];
    expect(looksToText(looks)).toBe('112233.40,abcdef.100-');
    expect(looksOfText(looksToText(looks), 2)).toEqual(looks);
  });

  it('is as usual where nothing is said, or nonsense', () => {
    const usual = looksOfText('', 3);
    expect(new Set(usual.map(({ colour }) => colour)).size).toBe(3);
    expect(usual.every(({ opacity, isShown }) => opacity === 1 && isShown)).toBe(true);
    expect(looksOfText('xyz,112233.5,112233.400', 3)).toMatchObject([usual[0], { opacity: 1 }, { opacity: 1 }]);
  });
});
