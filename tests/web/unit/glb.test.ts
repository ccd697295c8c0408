import { describe, expect, it } from 'vitest';
import { GlbReader, type Primitive } from '@/mesh/glb';

// A GLB whose primitives hold these bytes, in this order.
function glb(streams: number[][], change: (gltf: Record<string, unknown>) => void = () => undefined): Uint8Array {
  let offset = 0;
  const views = streams.map((bytes) => {
    const view = { buffer: 0, byteOffset: offset, byteLength: bytes.length };
    offset += Math.ceil(bytes.length / 4) * 4;
    return view;
  });
  const gltf: Record<string, unknown> = {
    asset: { version: '2.0' },
    bufferViews: views,
    accessors: streams.flatMap(() => [
      { count: 4, min: [0, 0, 0], max: [1, 2, 3] },
      { count: 6 },
    ]),
    meshes: [
      {
        primitives: streams.map((_, i) => ({
          attributes: { POSITION: 2 * i },
          indices: 2 * i + 1,
          extensions: { KHR_draco_mesh_compression: { bufferView: i, attributes: { POSITION: 7 } } },
        })),
      },
    ],
  };
  change(gltf);
  let json = JSON.stringify(gltf);
  json += ' '.repeat((4 - (json.length % 4)) % 4);
  const text = new TextEncoder().encode(json);
  const file = new Uint8Array(12 + 8 + text.length + 8 + offset);
  const view = new DataView(file.buffer);
  [0x46546c67, 2, file.length, text.length, 0x4e4f534a].forEach((word, i) => view.setUint32(4 * i, word, true));
  file.set(text, 20);
  view.setUint32(20 + text.length, offset, true);
  view.setUint32(24 + text.length, 0x004e4942, true);
  streams.forEach((bytes, i) => file.set(bytes, 28 + text.length + (views[i]?.byteOffset ?? 0)));
  return file;
}

// A GLB of two vertices and one triangle as they are: positions, normals, distances and indices.
function plainGlb(attributes: Record<string, number>, positions: object = {}): Uint8Array {
  const arrays = [24, 24, 8, 12].map((bytes, at) => new Array<number>(bytes).fill(at + 1));
  return glb(arrays, (gltf) => {
    gltf.accessors = [
      { bufferView: 0, componentType: 5126, count: 2, type: 'VEC3', min: [0, 0, 0], max: [1, 2, 3], ...positions },
      { bufferView: 1, componentType: 5126, count: 2, type: 'VEC3' },
      { bufferView: 2, componentType: 5126, count: 2, type: 'SCALAR' },
      { bufferView: 3, componentType: 5125, count: 3, type: 'SCALAR' },
    ];
    gltf.meshes = [{ primitives: [{ attributes, indices: 3 }] }];
  });
}

function read(file: Uint8Array, pieceBytes: number): { streams: number[][]; at: number[]; complete: boolean } {
  const streams: number[][] = [];
  const at: number[] = [];
  let received = 0;
  const reader = new GlbReader({
    onPrimitives: () => undefined,
    onStream: (index, bytes) => {
      streams[index] = [...bytes];
      at[index] = received;
    },
  });
  for (let begin = 0; begin < file.length; begin += pieceBytes) {
    received = Math.min(file.length, begin + pieceBytes);
    reader.take(file.subarray(begin, received));
  }
  return { streams, at, complete: reader.isComplete };
}

// All of it at once.
function taken(file: Uint8Array): { found: Primitive[]; order: number[]; complete: boolean } {
  const result = { found: [] as Primitive[], order: [] as number[] };
  const reader = new GlbReader({ onPrimitives: (parts) => (result.found = parts), onStream: (index) => result.order.push(index) });
  reader.take(file);
  return { ...result, complete: reader.isComplete };
}

const three = [[1, 2, 3], [4, 5, 6, 7, 8], [9]];

describe('GlbReader', () => {
  it('hands over every stream, however the bytes come', () => {
    const file = glb(three);
    for (const piece of [1, 3, 19, 64, file.length]) {
      expect(read(file, piece)).toMatchObject({ streams: three, complete: true });
    }
  });

  it('hands over a stream as soon as its last byte is there', () => {
    const file = glb(three);
    const { at } = read(file, 1);
    expect(at[0]).toBe(file.length - 16 + 3);
    expect(at[1]).toBe(file.length - 16 + 4 + 5);
  });

  it('says what a primitive holds', () => {
    expect(taken(glb([[1]])).found).toEqual([{ offset: 0, length: 1, positionId: 7, distanceId: null, isCoarse: false, triangles: 2, vertices: 4, low: [0, 0, 0], high: [1, 2, 3], part: null }]);
  });

  it('says whose surface a primitive is, and its colour as a screen has it', () => {
    const { found } = taken(
      glb(three, (gltf) => {
        const [{ primitives }] = gltf.meshes as [{ primitives: Record<string, unknown>[] }];
        const [first, second, last] = primitives;
        gltf.materials = [
          { pbrMetallicRoughness: { baseColorFactor: [0.68668531, 0.13013648, 0, 1] } },
          { name: 'without a colour' },
        ];
        gltf.meshes = [
          { primitives: [{ ...first, material: 0 }, { ...second, material: 0 }] },
          { primitives: [{ ...last, material: 1 }] },
        ];
        gltf.nodes = [
          { name: 'labels', children: [1, 2, 3] },
          { name: 'empty', extras: { label: 5 } },
          { name: 'Putamen', mesh: 1, extras: { label: -2 } },
          { name: 'Liver', mesh: 0, extras: { label: 7, voxels: 3 } },
        ];
      }),
    );
    const liver = { label: 7, colour: '#d86500' };
    expect(found.map(({ part }) => part)).toEqual([liver, liver, { label: -2, colour: '#ffffff' }]);
  });

  it('takes the coarsest level of detail, whose bytes come first, and the finest', () => {
    const { found, order, complete } = taken(
      glb(three, (gltf) => {
        const [mesh] = gltf.meshes as { primitives: unknown[] }[];
        gltf.meshes = mesh?.primitives.map((primitive) => ({ primitives: [primitive] })).reverse();
        gltf.materials = [{ pbrMetallicRoughness: { baseColorFactor: [0, 0, 0, 1] } }];
        gltf.nodes = [
          { mesh: 0, extras: { label: 3 }, extensions: { MSFT_lod: { ids: [1, 2] } } },
          { mesh: 1 },
          { mesh: 2 },
        ];
      }),
    );
    expect(found.map(({ length, isCoarse, part }) => [length, isCoarse, part?.label])).toEqual([
      [1, false, 3],
      [3, true, 3],
    ]);
    expect(order).toEqual([1, 0]);
    expect(complete).toBe(true);
  });

  it('says which attribute of a stream holds distances', () => {
    const { found } = taken(
      glb(three, (gltf) => {
        const [mesh] = gltf.meshes as { primitives: Record<string, { KHR_draco_mesh_compression: { attributes: object } }>[] }[];
        const draco = mesh?.primitives[1]?.extensions?.KHR_draco_mesh_compression;
        Object.assign(draco?.attributes ?? {}, { _DISTANCE_MM: 4 });
      }),
    );
    expect(found.map(({ distanceId }) => distanceId)).toEqual([null, 4, null]);
  });

  it('finds the arrays of a surface that is not compressed, which come together', () => {
    const file = plainGlb({ POSITION: 0, NORMAL: 1, _DISTANCE_MM: 2 });
    const { found, order, complete } = taken(file);
    expect(found).toMatchObject([{ offset: 0, length: 12 * 2 + 12 * 2 + 4 * 2 + 4 * 3, triangles: 1, vertices: 2, distanceId: null }]);
    const ranges = [[0, 24], [56, 68], [48, 56]];
    expect(found[0]?.arrays).toEqual({ ranges, vertices: 2, corners: 3, hasDistances: true });
    expect([order, complete]).toEqual([[0], true]);
    const without = taken(plainGlb({ POSITION: 0 })).found[0]?.arrays;
    expect(without).toEqual({ ranges: ranges.slice(0, 2), vertices: 2, corners: 3, hasDistances: false });
  });

  it('hands over arrays one behind the other, without the normals', () => {
    const file = plainGlb({ POSITION: 0, NORMAL: 1, _DISTANCE_MM: 2 });
    const values = (count: number, value: number): number[] => new Array<number>(count).fill(value);
    expect(read(file, 7).streams).toEqual([[...values(24, 1), ...values(12, 4), ...values(8, 3)]]);
  });

  it('refuses arrays of other numbers than floats and 32-bit indices', () => {
    expect(() => taken(plainGlb({ POSITION: 0 }, { componentType: 5123 }))).toThrow(/plain arrays/);
    expect(() => taken(plainGlb({ POSITION: 0 }, { count: 3 }))).toThrow(/plain arrays/);
  });

  it('is not complete while bytes are missing', () => {
    const file = glb(three);
    expect(read(file.subarray(0, file.length - 4), 16).complete).toBe(false);
    expect(read(file.subarray(0, 10), 4).complete).toBe(false);
  });

  it('refuses what is no GLB, or names bytes that it does not hold', () => {
    expect(() => read(new TextEncoder().encode('solid surface, or anything else'), 8)).toThrow(/not a GLB/);
    const beyond = glb(three, (gltf) => {
      (gltf.bufferViews as { byteLength: number }[]).forEach((view) => (view.byteLength += 1000));
    });
    expect(() => read(beyond, 64)).toThrow(/does not hold/);
    const bare = glb(three, (gltf) => {
      const [mesh] = gltf.meshes as { primitives: { extensions?: unknown }[] }[];
      delete mesh?.primitives[0]?.extensions;
    });
    expect(() => read(bare, 64)).toThrow(/not compressed/);
  });
});
