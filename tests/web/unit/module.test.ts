// The module as it is published: packed, unpacked into somebody's project, compiled against and run there.
import { execFile } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { Daemon, id } from './daemon';

const run = promisify(execFile);
const client = fileURLToPath(new URL('../../../client/', import.meta.url));
const web = join(client, 'web/node_modules');
const project = mkdtempSync(join(tmpdir(), 'isomesh-module-'));
const packageFile = join(client, 'javascript/package.json');
const readme = join(client, 'javascript/README.md');

beforeAll(async () => {
  const source = join(project, 'source');
  const module = join(project, 'node_modules/isomesh');
  mkdirSync(source);
  mkdirSync(module, { recursive: true });
  mkdirSync(join(project, 'node_modules/@types'));
  cpSync(packageFile, join(source, 'package.json'));
  await run('node', [join(client, 'javascript/build.mjs'), join(source, 'dist')]);
  const { stdout } = await run('npm', ['pack', '--silent', '--ignore-scripts', '--pack-destination', project], { cwd: source });
  await run('tar', ['-xzf', join(project, stdout.trim()), '-C', module, '--strip-components=1']);
  symlinkSync(join(web, '@types/node'), join(project, 'node_modules/@types/node'));
  writeFileSync(join(project, 'package.json'), '{ "type": "module" }');
}, 120_000);

afterAll(() => rmSync(project, { recursive: true }));

// The messages of the compiler about the code; empty if it is right.
async function faultsOf(code: string, lib: string[], types: string[], resolution = 'bundler'): Promise<string> {
  const module = resolution === 'bundler' ? 'esnext' : 'nodenext';
  const compilerOptions = {
    ...{ target: 'es2022', lib, types, module, moduleResolution: resolution },
    ...{ strict: true, exactOptionalPropertyTypes: true, skipLibCheck: false, noEmit: true },
  };
  writeFileSync(join(project, 'tsconfig.json'), JSON.stringify({ compilerOptions, files: ['code.ts'] }));
  writeFileSync(join(project, 'code.ts'), code);
  return run(join(web, '.bin/tsc'), ['-p', project]).then(
    () => '',
    (error: { stdout: string }) => error.stdout,
  );
}

// Needs nothing but the language.
const plain = `
import { ApiError, choicesOf, Client, isFinal, type Job, type JobRequest } from 'isomesh';
const client = new Client({ server: 'http://127.0.0.1:8080' });
export async function mesh(bytes: Uint8Array): Promise<ArrayBuffer> {
  const { volumes } = await client.upload(bytes, { name: 'head.nii.gz', onProgress: (sent: number) => sent });
  const request: JobRequest = { volume: volumes[0]?.volume?.id ?? '', iso: 60, formats: ['glb'] };
  const job: Job = await client.follow((await client.submitJob(request)).id);
  if (!isFinal(job.state)) throw new ApiError(0, job.id, '');
  return client.meshOf(job, 'glb');
}
export const refusals = (error: ApiError): number => choicesOf(error).size;
// @ts-expect-error a file's name is not its bytes
void client.upload('head.nii.gz');
// @ts-expect-error there is no such format
export const wrong: JobRequest = { volume: 'a', iso: 60, formats: ['jpeg'] };
`;

const withGlobals = `${plain}
void client.follow('a', AbortSignal.timeout(60_000), ({ progress }) => progress);
void client.estimateOf(new URLSearchParams({ volume: 'a' }));
void client.upload(new Blob(['a']));
export const text = async (): Promise<string> => (await client.slicePicture('a', 'z', 0, [0, 1])).text();
// @ts-expect-error it is a signal that is needed
void client.follow('a', 60_000);
`;

describe("the module's types", () => {
  it('need neither "dom" nor @types/node', async () => {
    expect(await faultsOf(plain, ['es2023'], [])).toBe('');
  }, 60_000);

  it('are those of Node with @types/node', async () => {
    const code = `import { readFile } from 'node:fs/promises';\n${withGlobals}
void client.upload(await readFile('head.nii.gz'));\n`;
    expect(await faultsOf(code, ['es2023'], ['node'], 'nodenext')).toBe('');
  }, 60_000);

  it('are those of a page with "dom"', async () => {
    const code = `${withGlobals}
export const picture = async (): Promise<string> => URL.createObjectURL(await client.slicePicture('a', 'z', 0, [0, 1]));
void client.upload(document.querySelector('input')!.files![0]!);\n`;
    expect(await faultsOf(code, ['es2023', 'dom'], [])).toBe('');
  }, 60_000);
});

describe('the module in Node', () => {
  const daemon = new Daemon('first');

  beforeAll(() => daemon.start());
  afterAll(() => daemon.stop());

  // The output of the program.
  async function outputOf(code: string, ...options: string[]): Promise<string> {
    writeFileSync(join(project, 'program.js'), code.replace('http://127.0.0.1:8080', daemon.address));
    const { stdout } = await run('node', [...options, 'program.js'], { cwd: project, timeout: 20_000 });
    return stdout;
  }

  it('lets its process end once nothing is followed any more', async () => {
    const output = await outputOf(`import { Client } from 'isomesh';
const client = new Client({ server: 'http://127.0.0.1:8080' });
await client.follow('${id}', AbortSignal.timeout(300)).catch((error) => console.log(error.name));`);
    expect(output).toBe('TimeoutError\n');
  }, 30_000);

  it('does what its README says in Node 18, too', async () => {
    const { engines } = JSON.parse(readFileSync(packageFile, 'utf8')) as { engines: { node: string } };
    expect(engines.node).toBe('>=18.18');
    // Takes away what Node 18 lacks, as far as newer ones do without it.
    writeFileSync(
      join(project, 'node18.js'),
      `import fs from 'node:fs';
import { syncBuiltinESMExports } from 'node:module';
for (const name of ['crypto', 'File', 'CustomEvent']) delete globalThis[name];
delete AbortSignal.any;
delete URL.canParse;
delete fs.openAsBlob;
syncBuiltinESMExports();`,
    );
    const example = /```js\n(.*?)```/s.exec(readFileSync(readme, 'utf8'))?.[1] ?? '';
    writeFileSync(join(project, 'head.nii.gz'), 'bytes');
    daemon.state = 'succeeded';
    expect(await outputOf(example, '--import', './node18.js')).toBe('0.5\n');
    expect(daemon.uploaded.toString()).toBe('bytes');
    expect(readFileSync(join(project, 'head.glb'), 'utf8')).toBe('glTF');
  }, 30_000);
});
