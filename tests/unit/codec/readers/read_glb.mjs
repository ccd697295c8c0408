// node read_glb.mjs FILE.glb OUT: what gltf-validator and draco3d, or meshoptimizer's decoder, make of a GLB
// file. Fails where the validator finds an error or a warning. Writes the primitives to OUT, each as the numbers of points,
// of triangles, of normals and of distances, then points, normals and distances as floats and triangles
// as indices. Points are what the nodes make of them, in LPS millimetres again where they move them.
import { readFileSync, writeFileSync } from 'node:fs';
import draco3d from 'draco3d';
import validator from 'gltf-validator';
import { MeshoptDecoder } from 'meshoptimizer';

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

const typedArrays = { 5120: Int8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };

// An accessor's numbers, as many of each element as it has, unpacked by meshoptimizer.
function unpacked(number) {
  const accessor = gltf.accessors[number];
  const view = gltf.bufferViews[accessor.bufferView];
  const { byteOffset, byteLength, byteStride, count, mode, filter } =
    view.extensions.EXT_meshopt_compression;
  const bytes = new Uint8Array(count * byteStride);
  const source = binary.subarray(byteOffset, byteOffset + byteLength);
  MeshoptDecoder.decodeGltfBuffer(bytes, count, byteStride, source, mode, filter);
  const all = new typedArrays[accessor.componentType](bytes.buffer);
  const perElement = byteStride / all.BYTES_PER_ELEMENT;
  const width = accessor.type === 'VEC3' ? 3 : 1;
  const scale = accessor.normalized ? 1 / 127 : 1;
  if (mode === 'TRIANGLES') return all;
  return Float32Array.from({ length: count * width }, (_, i) => all[Math.floor(i / width) * perElement + (i % width)] * scale);
}

function rotated([qx, qy, qz, qw], [x, y, z]) {
  const [tx, ty, tz] = [2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)];
  return [
    x + qw * tx + qy * tz - qz * ty,
    y + qw * ty + qz * tx - qx * tz,
    z + qw * tz + qx * ty - qy * tx,
  ];
}

// From the node's own coordinates to those of the scene.
function inScene(number, point) {
  const { translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] } = gltf.nodes[number];
  const moved = rotated(rotation, point.map((x, i) => x * scale[i])).map((x, i) => x + translation[i]);
  const parent = gltf.nodes.findIndex((node) => node.children?.includes(number));
  return parent < 0 ? moved : inScene(parent, moved);
}

function unpack(primitive, node) {
  const { POSITION, NORMAL, _DISTANCE_MM } = primitive.attributes;
  const stored = unpacked(POSITION);
  const points = new Float32Array(stored.length);
  for (let at = 0; at < stored.length; at += 3) {
    const [x, y, z] = inScene(node, [...stored.subarray(at, at + 3)]);
    points.set([1000 * x, -1000 * z, 1000 * y], at);
  }
  const normals = NORMAL === undefined ? new Float32Array() : unpacked(NORMAL);
  const distances = _DISTANCE_MM === undefined ? new Float32Array() : unpacked(_DISTANCE_MM);
  const indices = unpacked(primitive.indices);
  const counts = new Uint32Array([points.length / 3, indices.length / 3, normals.length / 3, distances.length]);
  return [counts, points, normals, distances, indices].map((array) => new Uint8Array(array.buffer));
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

await MeshoptDecoder.ready;
const primitives = (gltf.meshes ?? []).flatMap((mesh, number) =>
  mesh.primitives.flatMap((primitive) =>
    primitive.extensions ? decode(primitive) : unpack(primitive, gltf.nodes.findIndex((node) => node.mesh === number)),
  ),
);
writeFileSync(out, Buffer.concat(primitives));
