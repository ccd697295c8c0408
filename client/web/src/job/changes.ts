// The cause of a surface's changes since its extraction, in words.
import type { JobParameters, MeshSummary } from '../api/types';

export interface Change {
  title: string;
  before: string;
  after: string;
}

// Null if nothing did: then the numbers of before and after are the same.
export function changeOf({ passes }: Pick<JobParameters, 'passes'>, { simplified }: Pick<MeshSummary, 'simplified'>): Change | null {
  if (simplified) return { title: 'Change since extraction', before: 'as extracted', after: 'in the mesh' };
  return passes > 0 ? { title: 'Change by smoothing', before: 'before smoothing', after: 'after smoothing' } : null;
}
