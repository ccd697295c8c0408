import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vite';
import { thirdParty } from './third_party.mjs';

const nothing = fileURLToPath(new URL('src/mesh/nothing.ts', import.meta.url));

export default defineConfig({
  base: '/',
  // Draco's wrapper would read its file with these if it ran in Node.
  resolve: { alias: { fs: nothing, path: nothing } },
  build: {
    target: 'es2022',
    // Files of their own: the content security policy allows no data: addresses.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 900,
    // A phone waits longer for one more file than for a few kilobytes that it may not need.
    rollupOptions: { output: { experimentalMinChunkSize: 40_000 } },
  },
  plugins: [thirdParty()],
  worker: { format: 'es', plugins: () => [thirdParty()] },
});
