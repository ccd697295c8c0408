// node read_glb.mjs FILE.glb OUT: writes what readGlb of glb.mjs makes of a GLB file to OUT.
// node read_glb.mjs: the same of many files. Each is its kind, `glb` or `drc`, a space, its number of bytes, a line's end, and its
// bytes in standard input; then comes `ok` or `bad`, a space, a number of bytes and a line's end in standard output, with as many
// bytes of primitives, or of a reason.
import { readFileSync, writeFileSync } from 'node:fs';

import { readDraco, readGlb } from './glb.mjs';

const readers = { glb: readGlb, drc: readDraco };

async function answer(kind, bytes) {
  try {
    const made = Buffer.concat(await readers[kind](bytes));
    return ['ok', made];
  } catch (error) {
    return ['bad', Buffer.from(String(error.message))];
  }
}

async function serve() {
  let waiting = Buffer.alloc(0);
  for await (const piece of process.stdin) {
    waiting = Buffer.concat([waiting, piece]);
    for (;;) {
      const end = waiting.indexOf('\n');
      if (end < 0) break;
      const [kind, size] = waiting.toString('latin1', 0, end).split(' ');
      const next = end + 1 + Number(size);
      if (waiting.length < next) break;
      // A copy, so that its buffer begins with it.
      const [word, made] = await answer(kind, new Uint8Array(waiting.subarray(end + 1, next)));
      waiting = waiting.subarray(next);
      process.stdout.write(`${word} ${made.length}\n`);
      process.stdout.write(made);
    }
  }
}

const [file, out] = process.argv.slice(2);
if (file === undefined) {
  await serve();
} else {
  writeFileSync(out, Buffer.concat(await readGlb(new Uint8Array(readFileSync(file)))));
}
