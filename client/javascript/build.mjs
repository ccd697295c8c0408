// npm --prefix client/web run module: the page's api folder as a module of its own, in dist/ beside this file.
// Its source is the page's; only the endings that Node wants are added to the imports.
import { cpSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { fileURLToPath } from 'node:url';

const web = new URL('../web/', import.meta.url);
const dist = new URL('dist/', import.meta.url);
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
