import { expect, it } from 'vitest';
import type { Preview } from '@/volume/preview';
import { PreviewLoader } from '@/volume/preview_loader';
import type { Window } from '@/volume/slices';

interface Asked {
  window: Window;
  answer: (error?: Error) => Promise<void>;
}

// A loader whose requests are answered when the test says so.
function loader(): { asked: Asked[]; made: PreviewLoader; failures: unknown[] } {
  const asked: Asked[] = [];
  const failures: unknown[] = [];
  const fetch = (window: Window): Promise<Preview> =>
    new Promise((resolve, reject) => {
      const answer = (error?: Error): Promise<void> => {
        if (error) reject(error);
        else resolve({ window } as Preview);
        return new Promise((settled) => setTimeout(settled));
      };
      asked.push({ window, answer });
    });
  const made = new PreviewLoader({ fetch, onChange: () => undefined, onError: (error) => failures.push(error) });
  return { asked, made, failures };
}

it('fetches a preview over each window that is wanted, one at a time and the last one next', async () => {
  const { asked, made } = loader();
  for (let high = 100; high < 130; high += 1) made.want([0, high]);
  expect(asked.map(({ window }) => window)).toEqual([[0, 100]]);
  await asked[0]?.answer();
  expect(made.preview?.window).toEqual([0, 100]);
  expect(asked.map(({ window }) => window)).toEqual([[0, 100], [0, 129]]);
  await asked[1]?.answer();
  expect(made.preview?.window).toEqual([0, 129]);
  made.want([0, 129]);
  expect(asked).toHaveLength(2);
});

it('keeps the preview before one that fails, which is asked for again only when that is said', async () => {
  const { asked, made, failures } = loader();
  made.want([0, 100]);
  await asked[0]?.answer();
  made.want([0, 1000]);
  await asked[1]?.answer(new Error('unreachable'));
  expect(made.preview?.window).toEqual([0, 100]);
  expect(failures).toHaveLength(1);
  made.want([0, 1000]);
  expect(asked).toHaveLength(2);
  made.retry();
  await asked[2]?.answer();
  expect(made.preview?.window).toEqual([0, 1000]);
  made.retry();
  expect(asked).toHaveLength(3);
});
