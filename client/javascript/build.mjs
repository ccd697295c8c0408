// npm --prefix client/web run module: makes the module from the page's api folder. The output goes to dist/ beside
// this file, or to the folder that is given. Node wants file endings in imports, so these are added.
import { cpSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { fileURLToPath, pathToFileURL } from 'node:url';

const web = new URL('../web/', import.meta.url);
const [, , folder] = process.argv;
const dist = folder === undefined ? new URL('dist/', import.meta.url) : pathToFileURL(`${folder}/`);
const ts = createRequire(web)('typescript');

const host = ts.formatDiagnosticsWithColorAndContext;
const root = fileURLToPath(web);
const program = ts.createProgram([`${root}src/api/index.ts`], {
  target: ts.ScriptTarget.ES2022,
  module: ts.ModuleKind.ESNext,
  moduleResolution: ts.ModuleResolutionKind.Bundler,
  lib: ['lib.es2023.d.ts', 'lib.dom.d.ts', 'lib.dom.iterable.d.ts'],
  types: [],
  strict: true,
  noUncheckedIndexedAccess: true,
  declaration: true,
  // What is only for the page has types of "dom", which a project in Node may lack.
  stripInternal: true,
  rootDir: root,
  outDir: fileURLToPath(dist),
});

rmSync(dist, { recursive: true, force: true });
const { diagnostics } = program.emit();
const faults = [...ts.getPreEmitDiagnostics(program), ...diagnostics];
if (faults.length > 0) {
  const names = { getCurrentDirectory: () => root, getCanonicalFileName: (name) => name, getNewLine: () => '\n' };
  process.stderr.write(host(faults, names));
  process.exit(1);
}
cpSync(new URL('generated/api.d.ts', web), new URL('generated/api.d.ts', dist));

for (const name of readdirSync(dist, { recursive: true })) {
  if (!/\.(js|ts)$/.test(name)) continue;
  const file = new URL(name, dist);
  const text = readFileSync(file, 'utf8');
  writeFileSync(file, text.replace(/(from|import\() ?(['"])(\.\.?\/[^'"]+)\2/g, (all) => all.replace(/(['"])$/, '.js$1')));
}
