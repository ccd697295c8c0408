// The texts of an order: what it waits for, why, and when it goes on.
import type { Order, OrderState } from '../../api/types';
import { formatBytes, formatCount, formatTime } from '../../ui/format';

export const orderStates: readonly OrderState[] = ['waiting', 'fetching', 'meshing', 'sending', 'succeeded', 'failed', 'cancelled'];

// "in 12 s", "in 5 min", or the time of the day where it is farther away.
export function untilText(iso: string, now: number): string {
  const seconds = Math.ceil((new Date(iso).getTime() - now) / 1000);
  if (Number.isNaN(seconds)) return iso;
  if (seconds <= 0) return 'now';
  if (seconds < 100) return `in ${seconds} s`;
  return seconds < 5400 ? `in ${Math.round(seconds / 60)} min` : `at ${formatTime(iso)}`;
}

function doing({ state, source, send }: Order): string {
  const images = source.instances === null ? 'the series' : `${formatCount(source.instances)} images`;
  const targets = send.map(({ pacs }) => pacs).join(', ');
  switch (state) {
    case 'waiting':
      return source.instances === null ? 'waits until the series is complete' : `waits until no images are added (${images} so far)`;
    case 'fetching':
      return `reads ${images} from ${source.pacs}`;
    case 'meshing':
      return 'makes the mesh';
    case 'sending':
      return `stores the mesh in ${targets}`;
    default:
      return '';
  }
}

function stored({ results }: Order): string {
  const done = results.filter((result) => result.stored);
  if (done.length === 0) return 'nothing to store';
  const bytes = done.reduce((sum, { bytes: each }) => sum + each, 0);
  const places = [...new Set(done.map(({ pacs }) => pacs))].join(', ');
  return `${formatCount(done.length)} ${done.length === 1 ? 'object' : 'objects'} in ${places}, ${formatBytes(bytes)}`;
}

export interface Said {
  text: string;
  isBad: boolean;
  // The time of the next attempt.
  next: string;
}

export function saidOf(order: Order, now: number): Said {
  const { state, error, attempts, next_attempt: next } = order;
  if (state === 'succeeded') return { text: stored(order), isBad: false, next: '' };
  if (state === 'cancelled') return { text: '', isBad: false, next: '' };
  if (state === 'failed') return { text: error?.detail ?? '', isBad: true, next: '' };
  if (!error) return { text: doing(order), isBad: false, next: '' };
  const count = attempts === 1 ? '1 attempt failed' : `${formatCount(attempts)} attempts failed`;
  return { text: `${error.detail}; ${count}`, isBad: true, next: next === null ? '' : `next attempt ${untilText(next, now)}` };
}

// The beginning of a name is enough, and blanks stand for what separates its parts in DICOM.
export function nameAsked(text: string): string {
  const name = text.trim().replace(/[\s^,]+/g, '*');
  return name === '' || /[*?]$/.test(name) ? name : `${name}*`;
}

// As DICOM writes a day or a range of days.
export function daysAsked(from: string, to: string): string {
  const [first, last] = [from, to].map((day) => day.replaceAll('-', ''));
  return first === last ? (first ?? '') : `${first}-${last}`;
}
