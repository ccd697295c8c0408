import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

const here = (path: string): string => fileURLToPath(new URL(path, import.meta.url));

export default defineConfig({
  resolve: { alias: { 'playwright-core': here('node_modules/playwright-core'), yaml: here('node_modules/yaml') } },
  server: { fs: { allow: [here('../..')] } },
  test: {
    dir: here('../../tests/web'),
    include: ['**/browser/**/*.test.ts'],
    // What it looks at is large volumes of what other tests see in small ones: only for who wants the pictures.
    exclude: process.env.ISOMESH_PICTURES === undefined ? ['**/browser/pictures.test.ts'] : [],
    fileParallelism: false,
    // Software draws, on machines that have other things to do.
    expect: { poll: { timeout: 60_000, interval: 100 } },
    testTimeout: 300_000,
    hookTimeout: 120_000,
  },
});
