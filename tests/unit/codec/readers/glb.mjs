// What programs that are not ours make of GLB and Draco files: gltf-validator, draco3d and meshoptimizer's decoder.
import draco3d from 'draco3d';
import validator from 'gltf-validator';
import { MeshoptDecoder } from 'meshoptimizer';

const decoderModule = await draco3d.createDecoderModule({});
await MeshoptDecoder.ready;

const typedArrays = { 5120: Int8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };

function vectors(decoder, mesh, attribute) {
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

// A primitive's bytes: the numbers of points, of triangles, of normals and of distances, then points, normals and distances
// as floats and triangles as indices.
function packed(points, normals, distances, indices) {
  const counts = new Uint32Array([points.length / 3, indices.length / 3, normals.length / 3, distances.length]);
  return [counts, points, normals, distances, indices].map((array) => new Uint8Array(array.buffer));
}

// The bytes of a Draco stream. `find` says which attribute of the mesh is POSITION, NORMAL or _DISTANCE_MM, if any.
function decode(stream, find) {
  const decoder = new decoderModule.Decoder();
  const mesh = new decoderModule.Mesh();
  try {
    const status = decoder.DecodeArrayToMesh(new Int8Array(stream), stream.length, mesh);
    if (!status.ok()) throw new Error(status.error_msg());
    const values = (name) => {
      const attribute = find(decoder, mesh, name);
      return attribute === undefined ? new Float32Array() : vectors(decoder, mesh, attribute);
    };
    return packed(values('POSITION'), values('NORMAL'), values('_DISTANCE_MM'), triangles(decoder, mesh));
  } finally {
    decoderModule.destroy(mesh);
    decoderModule.destroy(decoder);
  }
}

// The bytes of a Draco file, as of a GLB's primitive.
export function readDraco(bytes) {
  return decode(bytes, (decoder, mesh, name) =>
    name === 'POSITION' ? decoder.GetAttribute(mesh, decoder.GetAttributeId(mesh, decoderModule.POSITION)) : undefined,
  );
}

function rotated([qx, qy, qz, qw], [x, y, z]) {
  const [tx, ty, tz] = [2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)];
  return [
    x + qw * tx + qy * tz - qz * ty,
    y + qw * ty + qz * tx - qx * tz,
    z + qw * tz + qx * ty - qy * tx,
  ];
}

// Some readers take the names of generic attributes from the stream's metadata. Throws if the attribute has no such name there.
function expectName(decoder, mesh, name, attribute) {
  const id = decoder.GetAttributeIdByMetadataEntry(mesh, 'name', name);
  if (id < 0 || decoder.GetAttribute(mesh, id).unique_id() !== attribute.unique_id()) {
    throw new Error(`the stream's metadata does not name ${name}`);
  }
}

class Glb {
  constructor(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const jsonBytes = view.getUint32(12, true);
    this.gltf = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + jsonBytes)));
    this.binary = bytes.subarray(20 + jsonBytes + 8);
  }

  part({ byteOffset, byteLength }) {
    return this.binary.subarray(byteOffset, byteOffset + byteLength);
  }

  // The bytes of a buffer view, unpacked by meshoptimizer if they are compressed.
  viewBytes({ extensions = {}, ...view }) {
    const compressed = extensions.EXT_meshopt_compression ?? extensions.KHR_meshopt_compression;
    if (compressed === undefined) return this.part(view).slice();
    const { byteStride, count, mode, filter } = compressed;
    const bytes = new Uint8Array(count * byteStride);
    MeshoptDecoder.decodeGltfBuffer(bytes, count, byteStride, this.part(compressed), mode, filter);
    return bytes;
  }

  // An accessor's numbers, as many of each element as it has.
  unpacked(number) {
    const { bufferView, componentType, count, type, normalized } = this.gltf.accessors[number];
    const view = this.gltf.bufferViews[bufferView];
    const all = new typedArrays[componentType](this.viewBytes(view).buffer);
    const width = type === 'VEC3' ? 3 : 1;
    if (view.byteStride === undefined) return Uint32Array.from(all); // indices
    const perElement = view.byteStride / all.BYTES_PER_ELEMENT;
    const scale = normalized ? 1 / 127 : 1;
    return Float32Array.from({ length: count * width }, (_, i) => all[Math.floor(i / width) * perElement + (i % width)] * scale);
  }

  // A coarser level of detail takes the place of the finest, which names it.
  parentOf(number) {
    const finest = this.gltf.nodes.findIndex((node) => node.extensions?.MSFT_lod?.ids.includes(number));
    return this.gltf.nodes.findIndex((node) => node.children?.includes(finest < 0 ? number : finest));
  }

  // From the node's own coordinates to those of the scene.
  inScene(number, point) {
    const { translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] } = this.gltf.nodes[number];
    const moved = rotated(rotation, point.map((x, i) => x * scale[i])).map((x, i) => x + translation[i]);
    const parent = this.parentOf(number);
    return parent < 0 ? moved : this.inScene(parent, moved);
  }

  unpack(primitive, node) {
    const { POSITION, NORMAL, _DISTANCE_MM } = primitive.attributes;
    const stored = this.unpacked(POSITION);
    // Floats without compression are LPS millimetres to the bit, which the nodes would round.
    const isPlain = this.gltf.extensionsRequired === undefined;
    const points = isPlain ? stored : new Float32Array(stored.length);
    for (let at = 0; at < stored.length && !isPlain; at += 3) {
      const [x, y, z] = this.inScene(node, [...stored.subarray(at, at + 3)]);
      points.set([1000 * x, -1000 * z, 1000 * y], at);
    }
    const normals = NORMAL === undefined ? new Float32Array() : this.unpacked(NORMAL);
    const distances = _DISTANCE_MM === undefined ? new Float32Array() : this.unpacked(_DISTANCE_MM);
    return packed(points, normals, distances, this.unpacked(primitive.indices));
  }

  primitives() {
    return (this.gltf.meshes ?? []).flatMap((mesh, number) =>
      mesh.primitives.flatMap((primitive) => {
        const draco = primitive.extensions?.KHR_draco_mesh_compression;
        if (draco === undefined) return this.unpack(primitive, this.gltf.nodes.findIndex((node) => node.mesh === number));
        return decode(this.part(this.gltf.bufferViews[draco.bufferView]), (decoder, read, name) => {
          if (!(name in draco.attributes)) return undefined;
          const attribute = decoder.GetAttributeByUniqueId(read, draco.attributes[name]);
          if (name.startsWith('_')) expectName(decoder, read, name, attribute);
          return attribute;
        });
      }),
    );
  }
}

// The bytes of a GLB's primitives, in the order of its meshes. Points are what the nodes make of them, in LPS millimetres
// again where they move them. Throws where the validator finds an error or a warning.
export async function readGlb(bytes) {
  const { numErrors, numWarnings, messages } = (await validator.validateBytes(bytes)).issues;
  if (numErrors + numWarnings > 0) {
    throw new Error(messages.map(({ code, pointer, message }) => `${code} at ${pointer}: ${message}`).join('\n'));
  }
  return new Glb(bytes).primitives();
}
