// Who touches whom: the walls between labels, the largest first, of those labels that the search finds.
import { client } from '../../client';
import { asApiError } from '../../api/problem';
import type { Job, Label, LabelSummary, WallSummary } from '../../api/types';
import { labelTitle } from '../../job/labels';
import { checkbox, h } from '../../ui/dom';
import { formatCount, formatValue } from '../../ui/format';
import { refusal } from '../../ui/notices';
import type { Scope } from '../../ui/signal';
import type { LabelSearch } from './label_search';

const mostRows = 500;

function title(label: Label | null, name: string | null): string {
  return label === null ? 'background' : labelTitle({ label, name });
}

// Empty where the job's server did not measure walls.
export function wallTable(scope: Scope, { id, mesh }: Job, search: LabelSearch<LabelSummary>): HTMLElement[] {
  if (mesh?.walls_count === undefined) return [];
  const body = h('tbody');
  let hasEdgeContacts = false;
  const count = h('p.hint', { role: 'status' });
  let all: readonly WallSummary[] = [];
  const fill = (): void => {
    const wanted = new Set(search.found.map(({ label }) => label));
    const touching = hasEdgeContacts ? all : all.filter(({ faces }) => faces !== 0);
    const rows = touching.filter(({ a, b }) => wanted.has(a) || (b !== null && wanted.has(b)));
    body.replaceChildren(
      ...rows.slice(0, mostRows).map(({ a, b, a_name: nameA, b_name: nameB, area_mm2: area, faces }) =>
        h('tr', [
          ...[title(a, nameA), title(b, nameB)].map((name) => h('td', name)),
          ...[`${formatValue(area)} mm\u00b2`, faces === undefined ? '' : formatCount(faces)].map((number) => h('td.number', number)),
        ]),
      ),
    );
    count.textContent = `${formatCount(rows.length)} of ${formatCount(touching.length)} walls, of the labels that the search finds${rows.length > mostRows ? `; the largest ${mostRows} are listed` : ''}`;
  };
  const table = h('div.walls', { tabindex: '0', role: 'group', 'aria-label': 'Walls' }, [
    h('table', h('thead', h('tr', h('th', 'Label'), h('th', 'touches'), h('th', 'Area'), h('th', 'Faces'))), body),
  ]);
  // An area between voxels that share no face is an artefact of the lattice.
  const choice = checkbox('Edge contacts: labels that meet at edges or corners of voxels only', false, (isOn) => {
    hasEdgeContacts = isOn;
    fill();
  });
  const details = h('details', h('summary', 'Who touches whom'), table, count, mesh.edge_contacts_count !== undefined && mesh.edge_contacts_count > 0 && choice);
  search.input.addEventListener('input', () => details.open && fill());
  details.addEventListener('toggle', () => {
    if (all.length > 0) return fill();
    client.wallsOfJob(id, scope.signal, { edgeContacts: true }).then(
      (walls) => {
        all = walls.sort((a, b) => b.area_mm2 - a.area_mm2);
        fill();
      },
      (error: unknown) => {
        if (!scope.isOver) details.replaceChildren(refusal(asApiError(error)));
      },
    );
  });
  return [details];
}
