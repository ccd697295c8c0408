// Reads without drawing.
import './dom.mjs';
import { bytesOf, hexesOfBytes, main, surface } from './report.mjs';

await main('@niivue/niivue', async (path, suffix) => {
  globalThis.document.createElement = () => ({ getContext: () => null });
  const { NVMesh } = await import('@niivue/niivue');
  const gl = new Proxy({}, { get: () => () => ({}) });
  const { pts, tris, rgba255 } = await NVMesh.readMesh(bytesOf(path).buffer, path, gl);
  return [surface(pts, tris.length / 3, suffix === 'ply' ? { colours: hexesOfBytes(rgba255, 4) } : {})];
});
