// The module `isomesh` (client/javascript) exports this.
export { Client } from './client';
export { adviceFor, ApiError, choicesOf, emptyReason } from './problem';
export { isFinal } from './types';
export type * from './types';
