import { isBusy, retryAfterOf, type HeaderValues } from './busy';
import type { Choice, FieldFault, MeshSummary, Problem } from './types';

// How a request may succeed: by accepting a note, or by choosing one of several.
export type Remedy = Pick<Problem, 'overridable' | 'choices'> & {
  /** The server keeps the uploaded bytes under this name. */
  kept?: string;
};

/** A request failed. `status` is the HTTP status, 0 if no whole response came, or -1 if the request could not be sent. */
export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly title: string,
    readonly detail: string,
    readonly faults: FieldFault[] = [],
    /** What to add to the request so that it succeeds. */
    readonly remedy: Remedy = {},
    /** A link that helps. */
    readonly link: { href: string; text: string } | null = null,
    /** A busy server (429, 503) wants the request again after so many seconds, if it says so. */
    readonly retryAfter?: number,
  ) {
    super(detail || title);
    this.name = 'ApiError';
  }

  get isUnreachable(): boolean {
    return this.status === 0;
  }
}

export function isSuccess(status: number): boolean {
  return status >= 200 && status < 300;
}

function isProblem(value: unknown): value is Problem {
  const problem = value as Problem | null;
  return typeof problem === 'object' && problem !== null && typeof problem.title === 'string';
}

export function errorOfProblem(problem: Problem, headers?: HeaderValues): ApiError {
  return new ApiError(
    problem.status,
    problem.title,
    problem.detail,
    Array.isArray(problem.errors) ? problem.errors : [],
    { overridable: problem.overridable, choices: problem.choices, kept: headers?.get('Isomesh-Upload') ?? undefined },
    null,
    headers && retryAfterOf(headers),
  );
}

// Reads an error response. A proxy before the daemon may send any body.
export function errorOf(status: number, body: string, headers?: HeaderValues): ApiError {
  try {
    const problem: unknown = JSON.parse(body);
    if (isProblem(problem)) return errorOfProblem({ ...problem, status }, headers);
  } catch {
    // The body is not JSON. Only the status is known.
  }
  const detail = isSuccess(status)
    ? 'The response is not one of isomeshd. A proxy before it may ask for a login.'
    : `The server answered with status ${status}.`;
  return new ApiError(status, `HTTP status ${status}`, detail, [], {}, null, headers && retryAfterOf(headers));
}

const surfaceIsEmpty = 'The surface is empty';

/** The reason why a mesh has no triangles, as a sentence. Jobs of an older server have none. */
export function emptyReason({ empty_reason: reason }: Pick<MeshSummary, 'empty_reason'>): string {
  return `${surfaceIsEmpty}${reason === undefined ? '' : `: ${reason}`}.`;
}

// As the server says it where a mesh is asked for.
export function emptySurface(mesh: MeshSummary): ApiError {
  return new ApiError(422, surfaceIsEmpty, `${emptyReason(mesh)} The option allowEmpty accepts that.`);
}

// For a response that lacks what the API says.
export function notTheApi(): ApiError {
  return new ApiError(-1, 'The response is not one of isomeshd', 'A proxy before the server may ask for a login.');
}

// The JSON of a response. Throws an ApiError for an error status, or if the body is not one of the API's.
export function jsonOf(status: number, body: string, headers?: HeaderValues): unknown {
  if (!isSuccess(status)) throw errorOf(status, body, headers);
  try {
    const value: unknown = JSON.parse(body);
    if (typeof value === 'object' && value !== null) return value;
  } catch {
    // The body is not JSON.
  }
  throw errorOf(status, body);
}

// Returns what to check after a request to another server than the page's own got no response.
function checksOf(server: string): string {
  const page = typeof location === 'undefined' ? undefined : location.origin;
  if (page === undefined || page === new URL(server).origin) {
    return `The server at ${server} did not respond. Check that isomeshd is running there and that the network works.`;
  }
  // Browsers do not tell pages that a server does not allow them. A page from a file has no origin that could be named.
  const origin = page === 'null' ? "'*'" : page;
  return (
    `The server at ${server} did not respond, or it does not allow pages of the origin ${page}. ` +
    `Check that isomeshd is running there with --cors-origin ${origin}, and that the network works.`
  );
}

// The error of a request that got no whole response. Without an address, the server is that of the page.
export function unreachable(cause?: unknown, server = ''): ApiError {
  const error = new ApiError(
    0,
    'The server cannot be reached',
    server ? checksOf(server) : 'The server did not respond. Check that isomeshd is running and that the network works.',
  );
  error.cause = cause;
  return error;
}

export function asApiError(error: unknown, server = ''): ApiError {
  if (error instanceof ApiError) return error;
  // fetch throws a TypeError when a connection fails. Only Node says more, in its cause.
  if (error instanceof TypeError) return unreachable(error.cause ?? error, server);
  return new ApiError(-1, 'An unexpected error occurred', String(error));
}

const advice: readonly [statuses: number[], text: string][] = [
  [[0], 'Try again when the server responds.'],
  [[401, 403], 'Enter an access token that has this permission.'],
  [[404, 410], 'The address is wrong, or what was there is not kept any more. Choose another one from the list.'],
  [[413], 'Crop or resample the volume, or ask the administrator to raise the limit.'],
  [[415], 'Send the volume in a format that the server reads. Raw samples need a description.'],
  [[422], 'Export the volume again from its source, or choose another one.'],
  [[429, 503], 'The server is busy. Try again in a moment.'],
  [[507], 'Erase volumes that you no longer need, then try again.'],
];

/** Says in one sentence what a person can do. Empty if the error's detail already does. */
export function adviceFor(error: ApiError): string {
  const isSaid = error.title === surfaceIsEmpty || (error.status === 422 && /\. (Add|Choose|Give|Send|Upload) /.test(error.detail));
  if (isSaid || error.remedy.overridable !== undefined || choicesOf(error).size > 0) return '';
  return advice.find(([statuses]) => statuses.includes(error.status))?.[1] ?? '';
}

// Returns whether a client should repeat the request: the server cannot be reached, is busy or shuts down, or a proxy before
// it says so.
export function isPassing(status: number): boolean {
  return isBusy(status) || [0, 408, 502, 504].includes(status);
}

// Returns whether what was asked for is not there, or not any more.
export function isGone(error: unknown): boolean {
  return [404, 410].includes(asApiError(error).status);
}

// Returns whether the same request may succeed later.
export function mayPass({ status }: ApiError): boolean {
  return ![400, 404, 410, 413, 415, 422].includes(status);
}

/** Groups the choices by their parameter. The next request may name one of each group. */
export function choicesOf({ remedy }: ApiError): Map<Choice['parameter'], Choice[]> {
  const byParameter = new Map<Choice['parameter'], Choice[]>();
  for (const choice of remedy.choices ?? []) {
    byParameter.set(choice.parameter, [...(byParameter.get(choice.parameter) ?? []), choice]);
  }
  return byParameter;
}
