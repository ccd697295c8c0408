// Bundles the page and serves it on this machine: node serve.mjs [PORT], 8000 unless given.
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join } from 'node:path';
import { build } from 'esbuild';

const here = import.meta.dirname;
const made = join(here, 'dist');
const types = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm' };
// measureUserAgentSpecificMemory() works on isolated pages only.
const headers = { 'Cross-Origin-Opener-Policy': 'same-origin', 'Cross-Origin-Embedder-Policy': 'require-corp' };

function bundle() {
  return build({
    absWorkingDir: here,
    // cornerstone3D looks for its workers at these places, seen from the page's module.
    entryPoints: {
      'page/main': 'main.js',
      'page/workers/polySegConverters': '@cornerstonejs/polymorphic-segmentation/dist/esm/workers/polySegConverters.js',
      'workers/computeWorker': '@cornerstonejs/tools/dist/esm/workers/computeWorker.js',
    },
    alias: {
      '@cornerstonejs/polymorphic-segmentation/dist': './node_modules/@cornerstonejs/polymorphic-segmentation/dist',
      '@cornerstonejs/tools/dist': './node_modules/@cornerstonejs/tools/dist',
      // A dependency of vtk.js (xmlbuilder2) takes these from Node.
      events: './node_modules/events/events.js',
      url: './node_url.js',
    },
    outdir: made,
    bundle: true,
    format: 'esm',
    target: 'es2022',
    loader: { '.wasm': 'file' },
    assetNames: '[name]',
    publicPath: '/',
    logLevel: 'warning',
  });
}

export async function serve(port) {
  await bundle();
  const server = createServer(async ({ url }, response) => {
    const { pathname } = new URL(url, 'http://localhost');
    const file = pathname === '/' ? join(here, 'index.html') : join(made, pathname);
    try {
      const bytes = await readFile(file);
      response.writeHead(200, { ...headers, 'Content-Type': types[extname(file)] ?? 'application/octet-stream' }).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  return new Promise((resolve, reject) => {
    server.once('error', reject);
    server.listen(port, '127.0.0.1', () => resolve(server));
  });
}

if (process.argv[1] === import.meta.filename) {
  const server = await serve(Number(process.argv[2] ?? 8000));
  console.log(`http://localhost:${server.address().port}`);
}
