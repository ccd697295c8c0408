// The folders of the page's views import each other in one direction only.
import { readdirSync, readFileSync } from 'node:fs';
import { join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { expect, test } from 'vitest';

const views = fileURLToPath(new URL('../../../client/web/src/views', import.meta.url));

const folders = readdirSync(views);

// The other folders of views that this one imports.
function importedBy(folder: string): string[] {
  const texts = readdirSync(join(views, folder)).map((name) => readFileSync(join(views, folder, name), 'utf8'));
  const paths = texts.flatMap((text) => [...text.matchAll(/(?:from|import\()\s*'(\.[^']+)'/g)].map(([, path = '']) => path));
  const targets = paths.map((path) => normalize(join(folder, path)).split('/')[0] ?? '');
  return [...new Set(targets)].filter((target) => target !== folder && folders.includes(target));
}

const imports = new Map(folders.map((folder) => [folder, importedBy(folder)]));

function reachableFrom(folder: string, seen = new Set<string>()): Set<string> {
  for (const next of imports.get(folder) ?? []) {
    if (!seen.has(next)) reachableFrom(next, seen.add(next));
  }
  return seen;
}

test('folders of views depend on each other in one direction', () => {
  expect(imports.get('jobs')).toContain('surface');
  expect(folders.filter((folder) => reachableFrom(folder).has(folder))).toEqual([]);
});
