import { describe, expect, it } from 'vitest';
import { Once } from '@/volume/once';

describe('what is asked for once', () => {
  it('is asked for again after a failure, and with another key', async () => {
    const once = new Once<string>();
    const asked: string[] = [];
    const get = (key: string, made: () => Promise<string>): Promise<string> =>
      once.get(key, () => {
        asked.push(key);
        return made();
      });
    await expect(get('a', () => Promise.reject(new Error('cut')))).rejects.toThrow('cut');
    expect(await Promise.all(['a', 'a', 'a'].map((key) => get(key, () => Promise.resolve('first'))))).toEqual(['first', 'first', 'first']);
    expect(await get('b', () => Promise.resolve('second'))).toBe('second');
    expect(asked).toEqual(['a', 'a', 'b']);
  });
});
