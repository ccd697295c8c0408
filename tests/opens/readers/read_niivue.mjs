// Reads without drawing.
import './dom.mjs';
import { main, bytesOf, surface } from './report.mjs';

await main('@niivue/niivue', async (path) => {
  globalThis.document.createElement = () => ({ getContext: () => null });
  const { NVMesh } = await import('@niivue/niivue');
  const gl = new Proxy({}, { get: () => () => ({}) });
  const { pts, tris } = await NVMesh.readMesh(bytesOf(path).buffer, path, gl);
  return [surface(pts, tris.length / 3)];
});
