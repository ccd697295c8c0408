import { afterEach, describe, expect, it } from 'vitest';
import { beginOf } from '@/views/jobs/job_filter';

const zone = process.env.TZ;

describe('the days of the list of jobs', () => {
  afterEach(() => {
    if (zone === undefined) delete process.env.TZ;
    else process.env.TZ = zone;
  });

  it('begin at midnight on the clock of the person, as the times of the list are', () => {
    process.env.TZ = 'Asia/Tokyo';
    expect(beginOf('2026-11-20')).toBe('2026-11-19T15:00:00Z');
    expect(beginOf('2026-11-20', 1)).toBe('2026-11-20T15:00:00Z');
    // This day has 25 hours.
    process.env.TZ = 'Europe/Berlin';
    expect([0, 1].map((later) => beginOf('2026-10-25', later))).toEqual(['2026-10-24T22:00:00Z', '2026-10-25T23:00:00Z']);
    expect(beginOf('2026-12-31', 1)).toBe('2026-12-31T23:00:00Z');
  });

  it.each(['Pacific/Honolulu', 'UTC', 'Asia/Tokyo'])('are in years that the server reads, in %s', (zone) => {
    process.env.TZ = zone;
    expect([0, 1].map((later) => beginOf('9999-12-31', later))).toEqual([
      { 'Pacific/Honolulu': '9999-12-31T10:00:00Z', UTC: '9999-12-31T00:00:00Z', 'Asia/Tokyo': '9999-12-30T15:00:00Z' }[zone],
      zone === 'Asia/Tokyo' ? '9999-12-31T15:00:00Z' : '9999-12-31T23:59:59Z',
    ]);
    expect(beginOf('12026-11-20')).toBe('9999-12-31T23:59:59Z');
    // Clocks of that time were not of whole hours.
    expect(beginOf('0099-06-15')).toMatch(/^0099-06-1[45]T/);
    expect(beginOf('0000-01-01')).toMatch(/^0000-01-01T/);
  });

  it('are none where none is chosen', () => {
    for (const day of [undefined, '', 'soon', '2026-11', '999999-11-20']) expect(beginOf(day), day).toBeUndefined();
  });
});
