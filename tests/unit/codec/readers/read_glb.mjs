// node read_glb.mjs FILE.glb OUT: what gltf-validator and draco3d make of a GLB file. Fails where the
// validator finds an error or a warning. Writes the primitives to OUT, each as the numbers of points,
// of triangles, of normals and of distances, then points, normals and distances as floats and triangles
// as indices.
import { readFileSync, writeFileSync } from 'node:fs';
import draco3d from 'draco3d';
import validator from 'gltf-validator';

const [file, out] = process.argv.slice(2);
const bytes = new Uint8Array(readFileSync(file));

const report = await validator.validateBytes(bytes);
const { numErrors, numWarnings, messages } = report.issues;
if (numErrors + numWarnings > 0) {
  for (const message of messages) {
    console.error(`${message.code} at ${message.pointer}: ${message.message}`);
  }
  process.exit(1);
}

const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
const jsonBytes = view.getUint32(12, true);
const gltf = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + jsonBytes)));
const binary = bytes.subarray(20 + jsonBytes + 8);
const decoderModule = await draco3d.createDecoderModule({});

function vectors(decoder, mesh, id) {
  const attribute = decoder.GetAttributeByUniqueId(mesh, id);
  const values = new decoderModule.DracoFloat32Array();
  decoder.GetAttributeFloatForAllPoints(mesh, attribute, values);
  const result = Float32Array.from({ length: values.size() }, (_, i) => values.GetValue(i));
  decoderModule.destroy(values);
  return result;
}

function triangles(decoder, mesh) {
  const result = new Uint32Array(mesh.num_faces() * 3);
  const corners = new decoderModule.DracoInt32Array();
  for (let face = 0; face < mesh.num_faces(); ++face) {
    decoder.GetFaceFromMesh(mesh, face, corners);
    for (let corner = 0; corner < 3; ++corner) {
      result[face * 3 + corner] = corners.GetValue(corner);
    }
  }
  decoderModule.destroy(corners);
  return result;
}

function decode(primitive) {
  const draco = primitive.extensions.KHR_draco_mesh_compression;
  const { byteOffset, byteLength } = gltf.bufferViews[draco.bufferView];
  const decoder = new decoderModule.Decoder();
  const mesh = new decoderModule.Mesh();
  const stream = binary.subarray(byteOffset, byteOffset + byteLength);
  const status = decoder.DecodeArrayToMesh(new Int8Array(stream), stream.length, mesh);
  if (!status.ok()) throw new Error(status.error_msg());
  const points = vectors(decoder, mesh, draco.attributes.POSITION);
  const normals =
    'NORMAL' in draco.attributes
      ? vectors(decoder, mesh, draco.attributes.NORMAL)
      : new Float32Array();
  const distances =
    '_DISTANCE_MM' in draco.attributes
      ? vectors(decoder, mesh, draco.attributes._DISTANCE_MM)
      : new Float32Array();
  const indices = triangles(decoder, mesh);
  const counts = new Uint32Array([
    points.length / 3,
    indices.length / 3,
    normals.length / 3,
    distances.length,
  ]);
  decoderModule.destroy(mesh);
  decoderModule.destroy(decoder);
  return [counts, points, normals, distances, indices].map((array) => new Uint8Array(array.buffer));
}

const primitives = (gltf.meshes ?? []).flatMap((mesh) => mesh.primitives.flatMap(decode));
writeFileSync(out, Buffer.concat(primitives));
