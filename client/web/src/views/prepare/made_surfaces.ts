// Links to the latest surfaces of a volume. If the list cannot be loaded, it stays empty.
import { client } from '../../client';
import { inWords, surfaceInWords } from '../../job/parameters';
import { h } from '../../ui/dom';
import { hashOf } from '../../ui/route';

const most = 3;

export function madeSurfaces(volumeId: string): HTMLElement {
  const element = h('div.made');
  client.listJobs('', { state: 'succeeded', volume: volumeId, limit: most }).then(
    ({ jobs: made, next }) => {
      if (made.length === 0) return;
      const item = ({ id, parameters }: (typeof made)[number]): HTMLElement =>
        h('li', h('a', { href: hashOf(['jobs', id]) }, surfaceInWords(parameters)), ` ${inWords(parameters)}`);
      element.replaceChildren(h('h2', 'Surfaces of this volume'), h('ul', ...made.map(item)), next === null ? '' : h('a', { href: hashOf(['jobs'], new URLSearchParams({ volume: volumeId })) }, 'All of them'));
    },
    () => undefined,
  );
  return element;
}
