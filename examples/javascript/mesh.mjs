// Turns a volume into a surface: node mesh.mjs FILE ISO OUT. The suffix of OUT chooses the format.
// ISOMESH_SERVER is the server's address, by default http://127.0.0.1:8080.
import { readFile, writeFile } from 'node:fs/promises';
import { basename, extname } from 'node:path';
import { ApiError, choicesOf, Client } from 'isomesh';

const [file, iso, target] = process.argv.slice(2);
// Number('') is 0.
if (!target || iso.trim() === '' || !Number.isFinite(Number(iso))) {
  console.error('Usage: node mesh.mjs FILE ISO OUT, with a number for ISO');
  process.exit(2);
}
const { ISOMESH_SERVER: server = 'http://127.0.0.1:8080', ISOMESH_TOKEN: token } = process.env;

async function mesh() {
  const client = new Client({ server, token });
  const { volumes } = await client.upload(await readFile(file), { name: basename(file) });
  const [{ volume }] = volumes;
  const format = extname(target).slice(1).toLowerCase();
  const submitted = await client.submitJob({ volume: volume.id, iso: Number(iso), formats: [format] });
  const job = await client.follow(submitted.id);
  if (job.state !== 'succeeded') throw new Error(job.error?.detail ?? `The job is ${job.state}.`);
  await writeFile(target, new Uint8Array(await client.meshOf(job, format)));
  console.log(`${target}: ${job.mesh.triangles} triangles, ${Math.round(job.mesh.area_mm2)} mm2`);
}

try {
  await mesh();
} catch (error) {
  console.error(error.message);
  // If the file leaves a choice open, the server lists the choices.
  if (error instanceof ApiError) {
    for (const [parameter, choices] of choicesOf(error)) {
      for (const { value, title } of choices) console.error(`  ${parameter}=${value}: ${title}`);
    }
  }
  process.exit(1);
}
