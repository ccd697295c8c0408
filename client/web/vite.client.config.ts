// The JavaScript client as one file, which the daemon serves as /client.js. It goes beside the page.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vite';

const published = new URL('../javascript/package.json', import.meta.url);
const { version } = JSON.parse(readFileSync(published, 'utf8')) as { version: string };

export default defineConfig({
  build: {
    target: 'es2022',
    emptyOutDir: false,
    minify: false,
    lib: { entry: fileURLToPath(new URL('src/api/index.ts', import.meta.url)), formats: ['es'], fileName: () => 'client.js' },
    rollupOptions: { output: { banner: `/*! isomesh ${version}: client of an isomesh server. Apache-2.0 */` } },
  },
});
