import draco3d from 'draco3d';
import { bytesOf, main, surface } from './report.mjs';

await main('draco3d', async (path) => {
  const module = await draco3d.createDecoderModule({});
  const decoder = new module.Decoder();
  const mesh = new module.Mesh();
  const bytes = bytesOf(path);
  const status = decoder.DecodeArrayToMesh(new Int8Array(bytes.buffer), bytes.length, mesh);
  if (!status.ok()) throw new Error(status.error_msg());
  const values = new module.DracoFloat32Array();
  decoder.GetAttributeFloatForAllPoints(mesh, decoder.GetAttribute(mesh, decoder.GetAttributeId(mesh, module.POSITION)), values);
  const points = Float32Array.from({ length: values.size() }, (_, at) => values.GetValue(at));
  return [surface(points, mesh.num_faces(), { normals: decoder.GetAttributeId(mesh, module.NORMAL) >= 0 })];
});
