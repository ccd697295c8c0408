import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

const here = (path: string): string => fileURLToPath(new URL(path, import.meta.url));

export default defineConfig({
  resolve: { alias: { 'playwright-core': here('node_modules/playwright-core'), yaml: here('node_modules/yaml') } },
  server: { fs: { allow: [here('../..')] } },
  test: {
    dir: here('../../tests/web'),
    include: ['**/browser/**/*.test.ts'],
    // They look at large volumes of what other tests see in small ones: only for who wants the pictures or the times.
    exclude: ['pictures', 'times']
      .filter((name) => process.env[`ISOMESH_${name.toUpperCase()}`] === undefined)
      .map((name) => `**/browser/${name}.test.ts`),
    fileParallelism: false,
    // Software draws, on machines that have other things to do.
    expect: { poll: { timeout: 60_000, interval: 100 } },
    testTimeout: 300_000,
    hookTimeout: 120_000,
  },
});
