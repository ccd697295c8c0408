import { expect, it } from 'vitest';
import { daysAsked, nameAsked } from '@/views/jobs/order_texts';

it('asks for names that begin so, however their parts are separated', () => {
  expect(['', ' ', 'Doe', 'doe, jane', 'van Dyck^A', '*Jane*', 'Do?'].map(nameAsked)).toEqual(['', '', 'Doe*', 'doe*jane*', 'van*Dyck*A*', '*Jane*', 'Do?']);
});

it('asks for days as DICOM writes them', () => {
  expect(daysAsked('', '')).toBe('');
  expect(daysAsked('2026-11-30', '')).toBe('20261130-');
  expect(daysAsked('', '2026-11-30')).toBe('-20261130');
  expect(daysAsked('2026-11-30', '2026-11-30')).toBe('20261130');
  expect(daysAsked('2026-11-01', '2026-11-30')).toBe('20261101-20261130');
});
