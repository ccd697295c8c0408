// The result for each volume of an upload of several.
import { errorOfProblem, type ApiError } from '../../api/problem';
import type { UploadedVolume, Volume } from '../../api/types';
import { h } from '../../ui/dom';
import { formatDims } from '../../ui/format';
import { hashOf } from '../../ui/route';
import type { Gathered } from '../../volume/gather';
import { skippedText, volumeName } from '../../volume/names';
import { acceptButton, choiceLists, openQuestion, questionOf, type Asked, type Choices } from './remedies';

// Either a volume or an error.
export interface Outcome {
  member: string;
  volume: Volume | null;
  wasThere: boolean;
  error: ApiError | null;
  // The choices with which the member was requested.
  choices: Choices;
  // The last question about it, which an answer that was rejected leaves open.
  asked: Asked | null;
}

// The member that stands for all DICOM files of an upload.
const dicomMember = '*.dcm';

export function outcomeOf({ member, status, volume, problem }: UploadedVolume, before: Choices, asked: Asked | null = null): Outcome {
  const error = problem && errorOfProblem(problem);
  const choices = { ...before, member };
  return { member, volume, wasThere: status === 200, error, choices, asked: error && openQuestion(error, choices, asked) };
}

// After another attempt with these choices that was rejected.
export function rejected(outcome: Outcome, choices: Choices, error: ApiError): Outcome {
  return { ...outcome, choices, error, asked: openQuestion(error, choices, outcome.asked) };
}

// True if the volumes may be masks of one structure each: of one size, each 0 and another whole number, or empty.
export function mayBeMasks(outcomes: readonly Outcome[]): boolean {
  const volumes = outcomes.flatMap(({ volume }) => volume ?? []);
  const [first] = volumes;
  if (!first || volumes.length < 2 || volumes.length < outcomes.length) return false;
  return volumes.every(
    ({ dims, range: [low, high], notes }) =>
      low === 0 && (high === 0 || notes.some(({ code }) => code === 'looks-like-labels')) && dims.every((size, axis) => size === first.dims[axis]),
  );
}

function storedRow(volume: Volume, wasThere: boolean): Node[] {
  return [
    h('a', { href: hashOf(['volumes', volume.id]) }, volumeName(volume)),
    h('span.faint', `${formatDims(volume.dims)}, ${wasThere ? 'already stored' : 'stored'}`),
  ];
}

function refusedRow(
  error: ApiError,
  name: string,
  { choices, asked }: Outcome,
  stored: Gathered['stored'],
  onAgain: (...each: [Choices, ...Choices[]]) => void,
): (Node | false)[] {
  return [
    h('b', name),
    h('p', questionOf(error, choices) || error.detail || error.title),
    acceptButton(error, choices, onAgain),
    ...choiceLists(asked, choices, stored, onAgain),
  ];
}

// `onAgain` has a refused one read once more, with other choices, or several times, with each of them.
export function outcomeList(
  outcomes: readonly Outcome[],
  stored: Gathered['stored'],
  onAgain: (outcome: Outcome, ...each: [Choices, ...Choices[]]) => void,
): HTMLElement {
  const row = (outcome: Outcome): HTMLElement => {
    const { member, volume, wasThere, error } = outcome;
    const name = member === dicomMember ? 'DICOM files' : member;
    return h('li', { 'data-member': member, class: !error ? 'stored' : questionOf(error, outcome.choices) ? 'asked' : 'refused' }, [
      ...(volume ? storedRow(volume, wasThere) : []),
      ...(error ? refusedRow(error, name, outcome, stored, (...each) => onAgain(outcome, ...each)) : []),
    ]);
  };
  const skipped = skippedText(outcomes.flatMap(({ volume }) => volume ?? []));
  return h('div.stack', [
    h('ul.outcomes', { 'aria-label': 'Volumes in the upload' }, ...outcomes.map(row)),
    skipped !== '' && h('p.skipped', skipped),
  ]);
}
