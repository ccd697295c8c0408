import type { Choice, FieldFault, Problem } from './types';

// Of a refusal: the note that a person may accept, and what there is to choose from.
export type Remedy = Pick<Problem, 'overridable' | 'choices'> & {
  // The name by which the daemon keeps what was uploaded.
  kept?: string;
};

// A request that the daemon refused, or (status 0) that never reached it.
export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly title: string,
    readonly detail: string,
    readonly faults: FieldFault[] = [],
    // What can be added to the request so that it is not refused again.
    readonly remedy: Remedy = {},
    // Where a person finds what is missing.
    readonly link: { href: string; text: string } | null = null,
  ) {
    super(detail || title);
    this.name = 'ApiError';
  }

  get isUnreachable(): boolean {
    return this.status === 0;
  }
}

function isProblem(value: unknown): value is Problem {
  const problem = value as Problem | null;
  return typeof problem === 'object' && problem !== null && typeof problem.title === 'string';
}

export function errorOfProblem(problem: Problem, kept?: string): ApiError {
  return new ApiError(
    problem.status,
    problem.title,
    problem.detail,
    Array.isArray(problem.errors) ? problem.errors : [],
    { overridable: problem.overridable, choices: problem.choices, kept },
  );
}

// What a refusal's body says; a proxy before the daemon may answer with anything.
export function errorOf(status: number, body: string, kept?: string): ApiError {
  try {
    const problem: unknown = JSON.parse(body);
    if (isProblem(problem)) return errorOfProblem({ ...problem, status }, kept);
  } catch {
    // Not JSON: the status has to do.
  }
  return new ApiError(status, `HTTP status ${status}`, `The server answered with status ${status}.`);
}

export function unreachable(): ApiError {
  return new ApiError(
    0,
    'The server cannot be reached',
    'The connection was lost. Is isomeshd running, and is the network there?',
  );
}

export function asApiError(error: unknown): ApiError {
  if (error instanceof ApiError) return error;
  // fetch tells nothing more about a connection that failed.
  if (error instanceof TypeError) return unreachable();
  return new ApiError(-1, 'Something went wrong in this page', String(error));
}

// What a person can do about it, in one sentence; empty when the detail says all.
export function adviceFor(error: ApiError): string {
  if (error.remedy.overridable !== undefined || choicesOf(error).size > 0) return '';
  switch (error.status) {
    case 0:
      return 'Try again when the connection is back.';
    case 401:
    case 403:
      return 'Enter a token that may do this.';
    case 404:
    case 410:
      return 'It may have been erased; choose another one from the list.';
    case 413:
      return 'Crop or resample it, or ask the administrator to raise the limit.';
    case 415:
      return 'NIfTI, NRRD, MetaImage, VTK images and DICOM are read; raw samples need a description.';
    case 422:
      return 'Export it again from its source, or choose another one.';
    case 429:
    case 503:
      return 'The server is busy; try again in a moment.';
    case 507:
      return 'Erase volumes that are not needed any more, then try again.';
    default:
      return '';
  }
}

// Whether the same request may be taken another time.
export function mayPass({ status }: ApiError): boolean {
  return ![400, 404, 410, 413, 415, 422].includes(status);
}

// The choices by their parameters: one of each can be taken.
export function choicesOf({ remedy }: ApiError): Map<Choice['parameter'], Choice[]> {
  const byParameter = new Map<Choice['parameter'], Choice[]>();
  for (const choice of remedy.choices ?? []) {
    byParameter.set(choice.parameter, [...(byParameter.get(choice.parameter) ?? []), choice]);
  }
  return byParameter;
}
