// node tests/bench/glb_codecs.mjs [VOLUME ISO]: sizes of one surface in each codec of GLB, the processor time that the
// decoders of npm take for them, and how far their normals are from those without a codec.
//
// Uses build/release/bin/isomesh, and the decoders that a build of the tests installs (tests/unit/codec/readers). Without
// arguments, the volume is the head of Debian's package mricron-data. docs/formats.md has the result.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { setFlagsFromString } from 'node:v8';
import { runInNewContext } from 'node:vm';
import { gzipSync } from 'node:zlib';

setFlagsFromString('--expose-gc');
const collectGarbage = runInNewContext('gc');

const root = fileURLToPath(new URL('../../', import.meta.url));
const readers = createRequire(join(root, 'tests/unit/codec/readers/'));
const draco = await readers('draco3d').createDecoderModule({});
const { MeshoptDecoder } = readers('meshoptimizer');
await MeshoptDecoder.ready;

const [volume = '/usr/share/mricron/templates/ch2.nii.gz', iso = '60'] = process.argv.slice(2);
const runs = 12;
const gridBits = 14;
const typedArrays = { 5120: Int8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };

function parsed(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const jsonBytes = view.getUint32(12, true);
  const gltf = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + jsonBytes)));
  return { gltf, binary: bytes.subarray(28 + jsonBytes) };
}

function dracoFloats(decoder, mesh, id, width) {
  const attribute = decoder.GetAttributeByUniqueId(mesh, id);
  const bytes = 4 * width * mesh.num_points();
  const pointer = draco._malloc(bytes);
  decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, draco.DT_FLOAT32, bytes, pointer);
  const values = draco.HEAPF32.slice(pointer / 4, pointer / 4 + bytes / 4);
  draco._free(pointer);
  return values;
}

function ofDraco({ gltf, binary }, { bufferView, attributes }) {
  const { byteOffset, byteLength } = gltf.bufferViews[bufferView];
  const stream = binary.subarray(byteOffset, byteOffset + byteLength);
  const decoder = new draco.Decoder();
  const buffer = new draco.DecoderBuffer();
  const mesh = new draco.Mesh();
  buffer.Init(new Int8Array(stream.buffer, stream.byteOffset, stream.length), stream.length);
  const status = decoder.DecodeBufferToMesh(buffer, mesh);
  if (!status.ok()) throw new Error(status.error_msg());
  const indexBytes = 12 * mesh.num_faces();
  const pointer = draco._malloc(indexBytes);
  decoder.GetTrianglesUInt32Array(mesh, indexBytes, pointer);
  const index = draco.HEAPU32.slice(pointer / 4, pointer / 4 + indexBytes / 4);
  draco._free(pointer);
  const made = { positions: dracoFloats(decoder, mesh, attributes.POSITION, 3), index };
  if (attributes.NORMAL !== undefined) made.normals = dracoFloats(decoder, mesh, attributes.NORMAL, 3);
  [mesh, buffer, decoder].forEach((object) => draco.destroy(object));
  return made;
}

// An accessor's numbers as a graphics processor takes them, with the padding of its elements.
function numbersOf({ gltf, binary }, number) {
  const { bufferView, componentType } = gltf.accessors[number];
  const { byteOffset, byteLength, byteStride = 0, extensions = {} } = gltf.bufferViews[bufferView];
  const packed = extensions.EXT_meshopt_compression ?? extensions.KHR_meshopt_compression;
  const bytes = packed ? new Uint8Array(packed.count * packed.byteStride) : binary.slice(byteOffset, byteOffset + byteLength);
  if (packed) {
    const source = binary.subarray(packed.byteOffset, packed.byteOffset + packed.byteLength);
    MeshoptDecoder.decodeGltfBuffer(bytes, packed.count, packed.byteStride, source, packed.mode, packed.filter);
  }
  return Object.assign(new typedArrays[componentType](bytes.buffer), { stride: byteStride });
}

function ofArrays(glb, { attributes, indices }) {
  const made = { positions: numbersOf(glb, attributes.POSITION), index: numbersOf(glb, indices) };
  if (attributes.NORMAL !== undefined) made.normals = numbersOf(glb, attributes.NORMAL);
  return made;
}

function decoded(bytes) {
  const glb = parsed(bytes);
  return glb.gltf.meshes[0].primitives.map((primitive) => {
    const stream = primitive.extensions?.KHR_draco_mesh_compression;
    return stream ? ofDraco(glb, stream) : ofArrays(glb, primitive);
  });
}

// The shortest processor times of some works, in milliseconds: other programs can only lengthen them. The works take turns.
function shortestTimes(works) {
  const times = works.map(() => Infinity);
  for (let run = 0; run < runs; run += 1) {
    works.forEach((work, number) => {
      collectGarbage();
      const began = process.cpuUsage();
      work();
      const { user, system } = process.cpuUsage(began);
      times[number] = Math.min(times[number], (user + system) / 1000);
    });
  }
  return times;
}

// The normals of all vertices, by their steps on a grid of the whole surface; null where several vertices share a step.
function normalsByStep(bytes, grid) {
  const { gltf } = parsed(bytes);
  const { translation = [0, 0, 0], scale } = gltf.nodes[0];
  const [tx, ty, tz] = translation.map((metres) => 1000 * metres);
  const low = [tx, -tz, ty]; // the node turns Y up
  const byStep = new Map();
  for (const { positions, normals } of decoded(bytes)) {
    const perVertex = positions.stride === 8 ? 4 : 3;
    const perNormal = normals.stride === 4 ? 4 : 3;
    const millimetres = positions.stride === 8 ? 1000 * scale[0] : 1;
    for (let v = 0; v * perVertex < positions.length; v += 1) {
      const step = [0, 1, 2].map((axis) => Math.round((positions[v * perVertex + axis] * millimetres + low[axis] - grid.low[axis]) / grid.step));
      const normal = [0, 1, 2].map((axis) => normals[v * perNormal + axis]);
      const key = (step[0] * 2 ** gridBits + step[1]) * 2 ** gridBits + step[2];
      const before = byStep.get(key);
      const isSame = before !== undefined && before !== null && before.every((x, axis) => x === normal[axis]);
      byStep.set(key, before === undefined || isSame ? normal : null);
    }
  }
  return byStep;
}

function degreesBetween(a, b) {
  const cross = Math.hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
  return (Math.atan2(cross, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * 180) / Math.PI;
}

function normalErrors(exact, found) {
  let [sum, most, count] = [0, 0, 0];
  for (const [key, normal] of exact) {
    const other = found.get(key);
    if (!normal || !other) continue;
    const degrees = degreesBetween(normal, other);
    sum += degrees;
    most = Math.max(most, degrees);
    count += 1;
  }
  return { mean: sum / count, most, count };
}

// The grid of a quantised file. It is a cube around the cells that the surface crosses, so bounds of the mesh do not tell it.
function gridOf(bytes) {
  const { translation, scale } = parsed(bytes).gltf.nodes[0];
  const [tx, ty, tz] = translation.map((metres) => 1000 * metres);
  return { low: [tx, -tz, ty], step: 1000 * scale[0] };
}

const folder = mkdtempSync(join(tmpdir(), 'glb-codecs-'));
try {
  const all = ['none', 'quantized', 'meshopt', 'khr-meshopt', 'draco'].map((codec) => {
    const [shaded, bare] = [[], ['--no-normals']].map((more, number) => {
      const file = join(folder, `${codec}-${number}.glb`);
      execFileSync(join(root, 'build/release/bin/isomesh'), ['-q', 'local', volume, '--iso', iso, '--glb-codec', codec, ...more, '-o', file]);
      return new Uint8Array(readFileSync(file));
    });
    return { codec, shaded, bare };
  });
  // The two extensions of meshoptimizer have the same bytes, so they get one row.
  const binaryOf = (name) => parsed(all.find(({ codec }) => codec === name).shaded).binary;
  if (Buffer.compare(binaryOf('meshopt'), binaryOf('khr-meshopt')) !== 0) throw new Error('meshopt and khr-meshopt differ');
  const made = all.filter(({ codec }) => codec !== 'khr-meshopt');
  const grid = gridOf(made.find(({ codec }) => codec === 'quantized').shaded);
  const exact = normalsByStep(made[0].shaded, grid);
  const triangles = decoded(made[0].shaded)[0].index.length / 3;
  console.log(`${triangles} triangles\n`);
  console.log('| `glb_codec` | size | without normals | size, gzip | decoding | normals: mean, largest error |');
  console.log('|---|---:|---:|---:|---:|---:|');
  const megabytes = (bytes) => `${(bytes / 1e6).toFixed(2)} MB`;
  const times = shortestTimes(made.map(({ shaded }) => () => decoded(shaded)));
  made.forEach(({ codec, shaded, bare }, number) => {
    const { mean, most, count } = normalErrors(exact, normalsByStep(shaded, grid));
    if (count < exact.size / 2) throw new Error(`only ${count} of ${exact.size} vertices of ${codec} were found`);
    console.log(
      `| ${codec === 'meshopt' ? '`meshopt`, `khr-meshopt`' : `\`${codec}\``} | ${megabytes(shaded.length)} | ${megabytes(bare.length)} | ${megabytes(gzipSync(shaded).length)} | ` +
        `${times[number].toFixed(0)} ms | ${mean.toFixed(3)}, ${most.toFixed(3)} degrees |`,
    );
  });
} finally {
  rmSync(folder, { recursive: true });
}
