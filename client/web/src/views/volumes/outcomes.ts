// The result for each volume of an upload of several.
import { errorOfProblem, type ApiError } from '../../api/problem';
import type { UploadedVolume, Volume } from '../../api/types';
import { h } from '../../ui/dom';
import { formatDims } from '../../ui/format';
import { hashOf } from '../../ui/route';
import { acceptButton, choiceForms, type Choices } from './remedies';

// Either a volume or an error.
export interface Outcome {
  member: string;
  volume: Volume | null;
  wasThere: boolean;
  error: ApiError | null;
  // The choices with which the member was requested.
  choices: Choices;
}

// The member that stands for all DICOM files of an upload.
const dicomMember = '*.dcm';

export function outcomeOf({ member, status, volume, problem }: UploadedVolume, before: Choices): Outcome {
  return {
    member,
    volume,
    wasThere: status === 200,
    error: problem && errorOfProblem(problem),
    choices: { ...before, member },
  };
}

function storedRow({ id, dims }: Volume, name: string, wasThere: boolean): Node[] {
  return [
    h('a', { href: hashOf(['volumes', id]) }, name),
    h('span', { class: 'faint' }, `${formatDims(dims)}, ${wasThere ? 'already stored' : 'stored'}`),
  ];
}

function refusedRow(
  error: ApiError,
  name: string,
  choices: Choices,
  onAgain: (choices: Choices) => void,
): (Node | false)[] {
  return [
    h('b', {}, name),
    h('p', {}, error.detail || error.title),
    acceptButton(error, choices, onAgain),
    ...choiceForms(error, choices, onAgain),
  ];
}

// `onAgain` has a refused one read once more, with other choices.
export function outcomeList(
  outcomes: readonly Outcome[],
  onAgain: (outcome: Outcome, choices: Choices) => void,
): HTMLElement {
  const row = (outcome: Outcome): HTMLElement => {
    const { member, volume, wasThere, error } = outcome;
    const name = member === dicomMember ? 'DICOM files' : member;
    return h(
      'li',
      { 'data-member': member, class: error ? 'refused' : 'stored' },
      ...(volume ? storedRow(volume, name, wasThere) : []),
      ...(error ? refusedRow(error, name, outcome.choices, (choices) => onAgain(outcome, choices)) : []),
    );
  };
  return h('ul', { class: 'outcomes', 'aria-label': 'Volumes in the upload' }, ...outcomes.map(row));
}
