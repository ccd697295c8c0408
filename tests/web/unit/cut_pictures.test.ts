import { expect, it } from 'vitest';
import { CutPictures } from '@/views/surface/cut_pictures';

type Answer = (error?: Error) => Promise<void>;

// Pictures whose requests are answered when the test says so.
function pictures(scope = { isOver: false }): { asked: Answer[]; shown: string[]; failures: unknown[]; made: CutPictures<string> } {
  const asked: Answer[] = [];
  const shown: string[] = [];
  const failures: unknown[] = [];
  const made = new CutPictures<string>(scope, {
    fetch: () =>
      new Promise((resolve, reject) => {
        asked.push((error) => {
          if (error) reject(error);
          else resolve('a picture');
          return new Promise((settled) => setTimeout(settled));
        });
      }),
    onPicture: (_, place) => shown.push(place),
    onError: (error) => failures.push(error),
  });
  return { asked, shown, failures, made };
}

it('fetches one picture at a time, and that of the last place next', async () => {
  const { asked, shown, made } = pictures();
  for (let index = 0; index < 9; index += 1) made.want(`z/${index}`);
  expect(asked).toHaveLength(1);
  await asked[0]?.();
  expect(asked).toHaveLength(2);
  await asked[1]?.();
  expect(shown).toEqual(['z/0', 'z/8']);
  expect(asked).toHaveLength(2);
});

it('fetches that of the present place though that of the place before failed', async () => {
  const { asked, shown, failures, made } = pictures();
  made.want('z/1');
  made.want('z/2');
  await asked[0]?.(new Error('unreachable'));
  expect(asked).toHaveLength(2);
  await asked[1]?.();
  expect(shown).toEqual(['z/2']);
  expect(failures).toEqual([]);
});

it('tells the failure of the present place, and asks for it when it is wanted again', async () => {
  const { asked, shown, failures, made } = pictures();
  made.want('z/1');
  await asked[0]?.(new Error('unreachable'));
  expect(failures).toHaveLength(1);
  expect(asked).toHaveLength(1);
  made.want('z/1');
  await asked[1]?.();
  expect(shown).toEqual(['z/1']);
});

it('asks for no more once nothing is cut, or the view is left', async () => {
  const scope = { isOver: false };
  const { asked, failures, made } = pictures(scope);
  made.want('z/1');
  made.want('');
  await asked[0]?.(new Error('unreachable'));
  made.want('z/2');
  made.want('z/3');
  scope.isOver = true;
  await asked[1]?.(new Error('unreachable'));
  expect(asked).toHaveLength(2);
  expect(failures).toEqual([]);
});
