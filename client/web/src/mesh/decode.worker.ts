// Decodes Draco streams beside the page, or takes plain arrays, and makes blocks of them.
import type { Attribute, DecoderModule } from 'draco3d';
import create from 'three/examples/jsm/libs/draco/gltf/draco_wasm_wrapper.js';
import wasmUrl from 'three/examples/jsm/libs/draco/gltf/draco_decoder.wasm?url';
import { prepare, split, type Block, type Triangles } from './blocks';
import type { PlainArrays } from './glb';
import { buffersIn, type WorkerScope } from './transfer';

export interface DecodeRequest {
  id: number;
  bytes: Uint8Array<ArrayBuffer>;
  // Undefined if the bytes are a Draco stream. The two numbers below are for such a stream only.
  arrays: PlainArrays | undefined;
  // The position attribute's number in the stream; null: the stream's only one.
  positionId: number | null;
  // The number of the attribute of distances; null: it has none.
  distanceId: number | null;
  // True if sharp edges are shaded as such: those of labels, at their walls.
  hasCreases: boolean;
}

export interface DecodeAnswer {
  id: number;
  blocks: Block[];
  error: string;
}

const scope = self as unknown as WorkerScope<DecodeRequest, DecodeAnswer>;

const ready = fetch(wasmUrl)
  .then((answer) => {
    if (!answer.ok) throw new Error('The decoder could not be loaded.');
    return answer.arrayBuffer();
  })
  .then((wasmBinary) => create({ wasmBinary }));

function copyOut<T>(draco: DecoderModule, bytes: number, read: (pointer: number) => T): T {
  const pointer = draco._malloc(bytes);
  try {
    return read(pointer);
  } finally {
    draco._free(pointer);
  }
}

function decode(draco: DecoderModule, { bytes, positionId, distanceId }: DecodeRequest): Triangles {
  const decoder = new draco.Decoder();
  const buffer = new draco.DecoderBuffer();
  const mesh = new draco.Mesh();
  try {
    buffer.Init(new Int8Array(bytes.buffer, bytes.byteOffset, bytes.length), bytes.length);
    const status = decoder.DecodeBufferToMesh(buffer, mesh);
    if (!status.ok() || mesh.ptr === 0) throw new Error(`Draco: ${status.error_msg()}`);
    const attribute =
      positionId === null
        ? decoder.GetAttribute(mesh, decoder.GetAttributeId(mesh, draco.POSITION))
        : decoder.GetAttributeByUniqueId(mesh, positionId);
    const corners = 3 * mesh.num_faces();
    const floatsOf = (one: Attribute, count: number): Float32Array<ArrayBuffer> => {
      if ((one as Attribute & { ptr: number }).ptr === 0) throw new Error('Draco: the stream lacks positions or distances');
      return copyOut(draco, 4 * count, (pointer) => {
        decoder.GetAttributeDataArrayForAllPoints(mesh, one, draco.DT_FLOAT32, 4 * count, pointer);
        return draco.HEAPF32.slice(pointer / 4, pointer / 4 + count);
      });
    };
    const index = copyOut(draco, 4 * corners, (pointer) => {
      decoder.GetTrianglesUInt32Array(mesh, 4 * corners, pointer);
      return draco.HEAPU32.slice(pointer / 4, pointer / 4 + corners);
    });
    const positions = floatsOf(attribute, 3 * mesh.num_points());
    if (distanceId === null) return { positions, index };
    return { positions, index, distances: floatsOf(decoder.GetAttributeByUniqueId(mesh, distanceId), mesh.num_points()) };
  } finally {
    draco.destroy(mesh);
    draco.destroy(buffer);
    draco.destroy(decoder);
  }
}

// Views of the bytes, which begin their buffer, so that all arrays are aligned.
function plain({ buffer }: Uint8Array<ArrayBuffer>, { vertices, corners, hasDistances }: PlainArrays): Triangles {
  const positions = new Float32Array(buffer, 0, 3 * vertices);
  const index = new Uint32Array(buffer, positions.byteLength, corners);
  if (!hasDistances) return { positions, index };
  return { positions, index, distances: new Float32Array(buffer, positions.byteLength + index.byteLength, vertices) };
}

// Copies a view of a larger buffer: a block must not keep the indices of its file in memory.
function owned(array: Float32Array<ArrayBuffer>): Float32Array<ArrayBuffer> {
  return array.byteLength < array.buffer.byteLength ? array.slice() : array;
}

function blockOf(triangles: Triangles, { hasCreases }: DecodeRequest): Block {
  const block = prepare(triangles, hasCreases);
  return { ...block, positions: owned(block.positions), ...(block.distances && { distances: owned(block.distances) }) };
}

async function trianglesOf(request: DecodeRequest): Promise<Triangles> {
  return request.arrays ? plain(request.bytes, request.arrays) : decode(await ready, request);
}

scope.onmessage = (event) => {
  const request = event.data;
  trianglesOf(request)
    .then((triangles) => {
      const blocks = split(triangles).map((part) => blockOf(part, request));
      scope.postMessage({ id: request.id, blocks, error: '' }, buffersIn(blocks));
    })
    .catch((error: unknown) => {
      scope.postMessage({ id: request.id, blocks: [], error: String(error) }, []);
    });
};
