// The page's tests stand in tests/web: unit/ the logic, browser/ the whole page in Chromium.
import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

const here = (path: string): string => fileURLToPath(new URL(path, import.meta.url));

export default defineConfig({
  resolve: {
    alias: {
      '@': here('src'),
      'playwright-core': here('node_modules/playwright-core'),
      yaml: here('node_modules/yaml'),
    },
  },
  server: { fs: { allow: [here('../..')] } },
  test: {
    dir: here('../../tests/web'),
    // A page's globals at import: only what the logic touches.
    setupFiles: [here('../../tests/web/unit/globals.ts')],
    include: ['**/unit/**/*.test.ts'],
    fileParallelism: false,
    // Some ask a server, on machines that have other things to do.
    testTimeout: 60_000,
  },
});
