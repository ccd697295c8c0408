import { describe, expect, it } from 'vitest';
import { Nearby } from '@/volume/nearby';

// Makers that answer when the test says so.
class Makers {
  readonly answers: (() => void)[] = [];
  readonly make = (value: string | Error) => (): Promise<string> =>
    new Promise((resolve, reject) => this.answers.push(() => (value instanceof Error ? reject(value) : resolve(value))));
  async answer(): Promise<void> {
    for (const answer of this.answers.splice(0)) answer();
    await new Promise((resolve) => setTimeout(resolve));
  }
}

describe('what was fetched lately', () => {
  it('is no more than it may be, also if all of it arrives later', async () => {
    const makers = new Makers();
    const nearby = new Nearby<string>(12);
    const keys = Array.from({ length: 500 }, (_, at) => `slice ${at}`);
    for (const key of keys) void nearby.get(key, makers.make(key));
    await makers.answer();
    expect(keys.filter((key) => nearby.find(key) !== null)).toEqual(keys.slice(-12));
  });

  it('is fetched again if it left before it arrived, and a failure of the first does not drop the second', async () => {
    const makers = new Makers();
    const nearby = new Nearby<string>(1);
    const first = nearby.get('a', makers.make(new Error('cut')));
    void nearby.get('b', makers.make('b'));
    const second = nearby.get('a', makers.make('a'));
    await Promise.all([makers.answer(), expect(first).rejects.toThrow('cut')]);
    expect(await second).toBe('a');
    expect([nearby.find('a'), nearby.find('b')]).toEqual(['a', null]);
    await nearby.get('a', makers.make('again'));
    expect(makers.answers).toHaveLength(0);
  });

  it('is fetched again after a failure', async () => {
    const makers = new Makers();
    const nearby = new Nearby<string>(2);
    const failed = nearby.get('a', makers.make(new Error('cut')));
    await Promise.all([makers.answer(), expect(failed).rejects.toThrow('cut')]);
    const again = nearby.get('a', makers.make('a'));
    await makers.answer();
    expect(await again).toBe('a');
  });
});
