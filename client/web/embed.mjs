// node embed.mjs DIST BYTES SOURCE: the built page as one file of bytes, and the C++ source that makes
// it part of the daemon (server/http/responses/page.h).
import { createHash } from 'node:crypto';
import { readdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { extname, join, relative, resolve } from 'node:path';
import { gzipSync } from 'node:zlib';

const [dist, bytesPath, sourcePath] = process.argv.slice(2);

const types = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
  '.css': 'text/css; charset=utf-8',
  '.svg': 'image/svg+xml',
  '.webp': 'image/webp',
  '.wasm': 'application/wasm',
};
// A zipped file has to be that much smaller to be worth unpacking.
const worthwhile = 0.9;

function filesBelow(folder) {
  return readdirSync(folder)
    .sort()
    .map((name) => join(folder, name))
    .flatMap((path) => (statSync(path).isDirectory() ? filesBelow(path) : [path]));
}

const pieces = [];
let size = 0;

function view(bytes) {
  if (bytes === null) return '{}';
  const text = `{bytes + ${size}, ${bytes.length}}`;
  pieces.push(bytes);
  size += bytes.length;
  return text;
}

const entries = filesBelow(dist).map((path) => {
  const name = relative(dist, path).replaceAll('\\', '/');
  const type = types[extname(name)];
  if (type === undefined) throw new Error(`${name}: the media type of this suffix is not known`);
  const plain = readFileSync(path);
  const zipped = gzipSync(plain, { level: 9 });
  const etag = createHash('sha256').update(plain).digest('hex').slice(0, 32);
  const url = name === 'index.html' ? '/' : `/${name}`;
  const fields = [
    `.path = "${url}"`,
    `.type = "${type}"`,
    `.etag = "${etag}"`,
    `.immutable = ${name.startsWith('assets/')}`,
    `.bytes = ${view(plain)}`,
    `.gzip = ${view(zipped.length < plain.length * worthwhile ? zipped : null)}`,
  ];
  return `      PageFile{${fields.join(', ')}},\n`;
});

writeFileSync(bytesPath, Buffer.concat(pieces));
writeFileSync(
  sourcePath,
  `// Made by client/web/embed.mjs.
#include <array>

#include "server/http/responses/page.h"

asm(R"(
.section .rodata
.hidden isomesh_page_bytes
.global isomesh_page_bytes
isomesh_page_bytes:
.incbin ${JSON.stringify(resolve(bytesPath))}
.previous
)");
extern "C" const char isomesh_page_bytes[];

namespace isomesh::http {

std::span<const PageFile> page_files() {
  static const char* const bytes = isomesh_page_bytes;
  static const std::array<PageFile, ${entries.length}> files = {
${entries.join('')}  };
  return files;
}

}  // namespace isomesh::http
`,
);
