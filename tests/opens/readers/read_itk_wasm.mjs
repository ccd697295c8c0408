import { readMeshNode } from '@itk-wasm/mesh-io';
import { main, surface } from './report.mjs';

await main('@itk-wasm/mesh-io', async (path) => {
  const mesh = await readMeshNode(path);
  const cells = mesh.cells;
  // A cell is its type (2: a triangle, 4: a polygon), the number of its points, and these.
  let triangles = 0;
  for (let at = 0; at < (cells?.length ?? 0); at += 2 + Number(cells[at + 1])) {
    if (Number(cells[at + 1]) === 3) triangles += 1;
  }
  const labels = mesh.cellData?.length && Number(mesh.numberOfCellPixels) > 0 ? [...new Set(mesh.cellData)].map(Number) : undefined;
  return [surface(mesh.points ?? [], triangles, { labels })];
});
