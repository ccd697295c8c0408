import { describe, expect, it } from 'vitest';
import { ApiError } from '@/api/problem';
import type { UploadedVolume } from '@/api/types';
import { mayBeMasks, outcomeOf, rejected } from '@/views/volumes/outcomes';
import { openQuestion, sortedSeries, spacingOf } from '@/views/volumes/remedies';

const question = new ApiError(422, 'Unusable volume', 'two series', [], { choices: [{ parameter: 'series', value: '1.2', title: 'head' }] });
const wrong = new ApiError(422, 'Unusable volume', 'slices are missing');

describe('a question of the server', () => {
  it('stays open after an answer that was rejected, until there is another one', () => {
    const first = openQuestion(question, {}, null);
    expect(first).toEqual({ error: question, choices: {} });
    expect(openQuestion(wrong, { series: '1.2' }, first)).toBe(first);
    expect(openQuestion(question, { member: 'a' }, first)).toEqual({ error: question, choices: { member: 'a' } });
    expect(openQuestion(wrong, {}, null)).toBeNull();
  });

  it('about one of several volumes, too', () => {
    const problem = { title: question.title, detail: question.detail, status: 422, choices: question.remedy.choices };
    const uploaded = { member: 'a.dcm', status: 422, volume: null, problem } as unknown as UploadedVolume;
    const asked = outcomeOf(uploaded, {}).asked;
    expect(asked?.choices).toEqual({ member: 'a.dcm' });
    const after = rejected(outcomeOf(uploaded, {}), { member: 'a.dcm', series: '1.2' }, wrong);
    expect([after.error, after.asked]).toEqual([wrong, asked]);
  });
});

describe('the series of an upload', () => {
  it('are listed by patient, date of the study and title', () => {
    const series = [
      ['Brown^Al', '20240501', 'head'],
      ['Carter^Bo', '20240501', 'head'],
      ['Adams^Cy', '20240502', 'a'],
      ['Adams^Cy', '20240501', 'head, series 10'],
      ['Adams^Cy', '20240501', 'head, series 9'],
    ].map(([name, date, title], n) => ({
      parameter: 'series' as const,
      value: String(n),
      title: title ?? '',
      series: { patient_name: name ?? '', patient_id: '', study_uid: date ?? '', study_description: '', study_date: date ?? '' },
    }));
    expect(sortedSeries(series).map(({ value }) => value)).toEqual(['4', '3', '2', '0', '1']);
  });
});

describe('volumes of one upload', () => {
  const stored = (dims: number[], range: number[], ...codes: string[]): UploadedVolume =>
    ({ member: 'a.nii', status: 201, problem: null, volume: { dims, range, notes: codes.map((code) => ({ code })) } }) as unknown as UploadedVolume;
  const mask = stored([4, 3, 2], [0, 1], 'looks-like-labels');
  const empty = stored([4, 3, 2], [0, 0]);
  const maybe = (...uploaded: UploadedVolume[]): boolean => mayBeMasks(uploaded.map((each) => outcomeOf(each, {})));

  it('are offered as masks if all may be some', () => {
    expect(maybe(mask, empty)).toBe(true);
    expect(maybe(mask)).toBe(false);
    for (const other of [
      stored([4, 3, 9], [0, 1], 'looks-like-labels'),
      stored([4, 3, 2], [-1024, 3071]),
      stored([4, 3, 2], [1, 2], 'looks-like-labels'),
      { member: 'b.nii', status: 422, volume: null, problem: { title: '', detail: '', status: 422 } } as unknown as UploadedVolume,
    ])
      expect(maybe(mask, other)).toBe(false);
  });
});

describe('the distances between samples', () => {
  it('are checked before they are sent', () => {
    expect(spacingOf('0.5 0.5 2')).toEqual({ value: '0.5,0.5,2', fault: '' });
    for (const text of ['', '1 1', '1 1 1 1', 'a b c']) expect(spacingOf(text).fault, text).toContain('three numbers');
    for (const text of ['0 1 1', '1 -1 1']) expect(spacingOf(text).fault, text).toContain('positive');
  });
});
