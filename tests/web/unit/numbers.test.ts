import { describe, expect, it } from 'vitest';
import { formatNumber, formatValue } from '@/ui/format';
import { numberOf, numbersOf, stepped, textFault } from '@/ui/numbers';

describe('a number that is typed', () => {
  it('has a point or one comma before its decimals', () => {
    const read: [string, number][] = [
      ['0,7', 0.7], ['0.7', 0.7], ['65,5', 65.5], ['70.25', 70.25], [',5', 0.5], ['.5', 0.5], ['1,', 1], ['1.', 1],
      ['-300', -300], ['-0,25', -0.25], ['+5', 5], ['1e2', 100], ['1,5e-3', 0.0015], [' 12 ', 12],
      ['1.234', 1.234], ['0,703', 0.703], ['1234,567', 1234.567], ['1,2345', 1.2345],
    ];
    for (const [text, value] of read) {
      expect(numberOf(text), text).toBe(value);
      expect(textFault(text), text).toBe('');
    }
  });

  it('is read as the page writes it', () => {
    for (const value of [-1250, 1_234_567, -0.25, 12.5]) expect(numberOf(formatValue(value))).toBe(value);
    expect(numberOf(formatNumber(-1234.5))).toBe(-1234.5);
    expect(numberOf('1 250')).toBe(1250);
  });

  it('is none where it could be two, or is something else', () => {
    for (const text of ['1.234,5', '1,234.5', '1,2,3', '1.2.3', '1,250', '-12,500', 'abc', '-', 'e', '1e', '1 2', '12 50', '0x10', 'Infinity', '1e999', 'NaN', '3 mm']) {
      expect(numberOf(text), text).toBeNaN();
      expect(textFault(text), text).not.toBe('');
    }
    expect(textFault('1,250')).toBe('1,250 can mean 1.250 or 1250. Enter one of these.');
    expect(textFault('1.234,5')).toContain('one decimal point');
    expect(textFault('abc')).toBe('Enter a number.');
  });

  it('may be missing', () => {
    expect([numberOf(''), numberOf('  ')]).toEqual([null, null]);
    expect(textFault('')).toBe('');
  });
});

describe('the arrow keys', () => {
  it('go a step up or down, within the limits and without a rest', () => {
    expect(stepped(0.1, 1, { step: 0.2 })).toBe(0.3);
    expect(stepped(65.5, -1, {})).toBe(64.5);
    expect(stepped(null, 1, { step: 0.01 })).toBe(0.01);
    expect(stepped(null, -1, { min: 4 })).toBe(4);
    expect(stepped(10, 1, { max: 10 })).toBe(10);
  });
});

describe('numbers in one text', () => {
  it('are separated in any way that people type', () => {
    const texts = ['0.5 0.5 2', '0.5,0.5,2', '0.5, 0.5, 2', '0.5 , 0.5 , 2', '0.5x0.5x2', '0.5 \u00d7 0.5 \u00d7 2 mm', '0,5 0,5 2', '0,5; 0,5; 2', ' .5;.5;2mm '];
    for (const text of texts) expect(numbersOf(text), text).toEqual([0.5, 0.5, 2]);
  });

  it('are not guessed', () => {
    for (const text of ['0.5 0.5 two', '1,250 1 1', '(1, 1, 1)', '1,,1', '']) expect(numbersOf(text).some(Number.isNaN), text).toBe(true);
    expect(numbersOf('0,5,0,5,2')).toHaveLength(5);
    expect(numbersOf('1 2,3')).toEqual([1, 2.3]);
  });
});
