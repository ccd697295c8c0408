// Writes API.md beside this file: the methods of the module's class Client, from its source. With --check it fails if API.md is old.
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const web = new URL('../web/', import.meta.url);
const ts = createRequire(web)('typescript');
const source = readFileSync(new URL('src/api/client.ts', web), 'utf8');
const file = ts.createSourceFile('client.ts', source, ts.ScriptTarget.ES2022, true);

// Types such as GlobalBlob are Blob where the library `dom` or @types/node is.
const plain = (node) => node.getText(file).replace(/\s+/g, ' ').replace(/\bGlobal(?=[A-Z])/g, '').replaceAll(', }', ' }');
const comment = (node) => ts.getJSDocCommentsAndTags(node).map(({ comment }) => ts.getTextOfJSDocComment(comment) ?? '').join(' ').replace(/\s+/g, ' ');
const isInternal = (node) => ts.getJSDocTags(node).some(({ tagName }) => tagName.text === 'internal');

const lines = [
  '# Methods of `Client`',
  '',
  '`node client/javascript/reference.mjs` writes this file from [client.ts](../web/src/api/client.ts). All methods return promises, and reject with an `ApiError` if a',
  'request fails. The types of volumes, jobs and parameters are those of [openapi.yaml](../../proto/openapi.yaml), which describes their members.',
];
const owner = file.statements.find((node) => ts.isClassDeclaration(node) && node.name?.text === 'Client');
for (const member of owner.members) {
  if (!(ts.isMethodDeclaration(member) || ts.isConstructorDeclaration(member)) || isInternal(member)) continue;
  const heading = /^ *\/\/ --- (.*) ---$/m.exec(source.slice(member.pos, member.getStart(file)))?.[1];
  if (heading) lines.push('', `## ${heading}`);
  const name = ts.isMethodDeclaration(member) ? `${member.name.text}` : 'new Client';
  const returned = member.type ? `: ${plain(member.type)}` : '';
  const text = comment(member);
  if (text === '') throw new Error(`${name} has no comment in client.ts`);
  lines.push('', '```ts', `${name}(${member.parameters.map(plain).join(', ')})${returned}`, '```', '', text);
}

const target = new URL('API.md', import.meta.url);
const made = `${lines.join('\n')}\n`;
if (process.argv[2] !== '--check') writeFileSync(target, made);
else if (readFileSync(target, 'utf8') !== made) {
  console.error('client/javascript/API.md is old: run node client/javascript/reference.mjs');
  process.exit(1);
}
