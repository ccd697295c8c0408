// A GLB file (glTF 2.0) read while it arrives: the description first, then each Draco stream of it, or
// each surface that is not compressed, as soon as its bytes are there.

import type { Label } from '../api/types';
const magic = 0x46546c67;
const jsonChunk = 0x4e4f534a;
const binaryChunk = 0x004e4942;
const headerBytes = 20; // of the file and of its first chunk
const chunkHeaderBytes = 8;
const largestJson = 256 * 1024 * 1024;
// glTF 2.0, section 3.6.2.
const floatType = 5126;
const unsignedIntType = 5125;

type Range = readonly [begin: number, end: number];

// The arrays of a primitive that is not compressed. They are handed over one behind the other.
export interface PlainArrays {
  // In the binary chunk: positions as floats, 32-bit indices, and distances as floats if the file has them.
  ranges: readonly Range[];
  vertices: number;
  corners: number;
  hasDistances: boolean;
}

export interface Primitive {
  // Place in the binary chunk.
  offset: number;
  length: number;
  // Missing if the primitive is a Draco stream.
  arrays?: PlainArrays;
  // The numbers of the attributes in a Draco stream; null where there are none.
  positionId: number | null;
  distanceId: number | null;
  // Of the coarsest level of detail, which stands for finer ones while these come, and while it moves.
  isCoarse: boolean;
  triangles: number;
  vertices: number;
  low: [number, number, number];
  high: [number, number, number];
  part: Part | null;
}

// A label's own surface, in a node of its own.
export interface Part {
  label: Label;
  colour: string; // #rrggbb
}

interface Accessor {
  bufferView?: number;
  componentType?: number;
  count: number;
  min?: number[];
  max?: number[];
}

interface Gltf {
  asset?: { extras?: unknown };
  meshes?: {
    primitives: {
      attributes: Record<string, number>;
      indices?: number;
      material?: number;
      extensions?: {
        KHR_draco_mesh_compression?: { bufferView: number; attributes: Record<string, number> };
      };
    }[];
  }[];
  nodes?: {
    mesh?: number;
    extras?: { label?: unknown } | null;
    extensions?: { MSFT_lod?: { ids?: number[] } };
  }[];
  materials?: { pbrMetallicRoughness?: { baseColorFactor?: number[] } }[];
  accessors?: Accessor[];
  bufferViews?: { byteOffset?: number; byteLength: number }[];
}

function vector(values: number[] | undefined): [number, number, number] {
  return [values?.[0] ?? 0, values?.[1] ?? 0, values?.[2] ?? 0];
}

// glTF's colours are linear, a screen's are not (IEC 61966-2-1).
function screenColour([red = 1, green = 1, blue = 1]: readonly number[]): string {
  const encode = (linear: number): number =>
    linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
  const digits = (linear: number): string =>
    Math.round(255 * Math.min(1, Math.max(0, encode(linear))))
      .toString(16)
      .padStart(2, '0');
  return `#${digits(red)}${digits(green)}${digits(blue)}`;
}

// A mesh's place: whose it is, and its level of detail: 0 is the finest, of `levels`.
interface Place {
  label: Label | undefined;
  level: number;
  levels: number;
}

// By the meshes' numbers.
function isLabel(value: unknown): value is Label {
  return Number.isInteger(value) || (typeof value === 'string' && /^-?\d+$/.test(value));
}

function placesOf({ nodes = [] }: Gltf): Map<number, Place> {
  const places = new Map<number, Place>();
  const put = (mesh: number | undefined, place: Place): void => {
    if (mesh !== undefined) places.set(mesh, place);
  };
  const coarser = nodes.map(({ extensions }) => extensions?.MSFT_lod?.ids ?? []);
  const areNamed = new Set(coarser.flat());
  nodes.forEach(({ mesh, extras }, number) => {
    if (areNamed.has(number)) return;
    const label = isLabel(extras?.label) ? extras.label : undefined;
    const ids = coarser[number] ?? [];
    [mesh, ...ids.map((id) => nodes[id]?.mesh)].forEach((one, level) =>
      put(one, { label, level, levels: ids.length + 1 }),
    );
  });
  return places;
}

// The place of arrays that hold a surface as it is; null where an array is missing or has other numbers.
function plainPlaceOf(
  gltf: Gltf,
  { attributes, indices }: { attributes: Record<string, number>; indices?: number },
): { offset: number; length: number; arrays: PlainArrays } | null {
  const arrayOf = (number: number | undefined, type: number, width: number): { begin: number; end: number; count: number } | null => {
    const accessor = gltf.accessors?.[number ?? -1];
    const view = gltf.bufferViews?.[accessor?.bufferView ?? -1];
    if (!accessor || !view || accessor.componentType !== type || view.byteLength !== 4 * width * accessor.count) return null;
    const begin = view.byteOffset ?? 0;
    return { begin, end: begin + view.byteLength, count: accessor.count };
  };
  const positions = arrayOf(attributes.POSITION, floatType, 3);
  const index = arrayOf(indices, unsignedIntType, 1);
  if (!positions || !index) return null;
  const distances = arrayOf(attributes._DISTANCE_MM, floatType, 1);
  const ranges = [positions, index, ...(distances ? [distances] : [])].map(({ begin, end }) => [begin, end] as const);
  const offset = Math.min(...ranges.map(([begin]) => begin));
  return {
    offset,
    length: Math.max(...ranges.map(([, end]) => end)) - offset,
    arrays: { ranges, vertices: positions.count, corners: index.count, hasDistances: distances !== null },
  };
}

// Of the finest level of detail, and of the coarsest where there are several.
export function primitivesOf(gltf: Gltf): Primitive[] {
  const places = placesOf(gltf);
  const primitives = (gltf.meshes ?? []).flatMap((mesh, number) => {
    const { label, level, levels } = places.get(number) ?? { label: undefined, level: 0, levels: 1 };
    if (level > 0 && level < levels - 1) return [];
    return mesh.primitives.map((primitive) => ({ primitive, label, isCoarse: level > 0 }));
  });
  return primitives.map(({ primitive, label, isCoarse }) => {
    const material = gltf.materials?.[primitive.material ?? -1]?.pbrMetallicRoughness;
    const draco = primitive.extensions?.KHR_draco_mesh_compression;
    const view = draco && gltf.bufferViews?.[draco.bufferView];
    const position = gltf.accessors?.[primitive.attributes.POSITION ?? -1];
    const indices = gltf.accessors?.[primitive.indices ?? -1];
    const positionId = draco?.attributes.POSITION;
    const place = view ? { offset: view.byteOffset ?? 0, length: view.byteLength } : plainPlaceOf(gltf, primitive);
    if (!place || !position || !indices || (draco && positionId === undefined)) {
      throw new Error('The GLB file holds a mesh that is not compressed with Draco and not stored as plain arrays.');
    }
    return {
      ...place,
      positionId: positionId ?? null,
      distanceId: draco?.attributes._DISTANCE_MM ?? null,
      isCoarse,
      triangles: indices.count / 3,
      vertices: position.count,
      low: vector(position.min),
      high: vector(position.max),
      part: label === undefined ? null : { label, colour: screenColour(material?.baseColorFactor ?? []) },
    };
  });
}

export interface GlbListener {
  onPrimitives: (primitives: Primitive[]) => void;
  // The bytes are the listener's to keep.
  onStream: (index: number, bytes: Uint8Array<ArrayBuffer>) => void;
}

export class GlbReader {
  private head: Uint8Array = new Uint8Array(0);
  private jsonBytes = -1;
  private binary: Uint8Array<ArrayBuffer> | null = null;
  private filled = 0;
  private primitives: Primitive[] = [];
  // The primitives' numbers as their bytes come.
  private order: number[] = [];
  private next = 0;

  constructor(private readonly listener: GlbListener) {}

  // True once every primitive has been handed over.
  get isComplete(): boolean {
    return this.jsonBytes >= 0 && this.next === this.primitives.length;
  }

  take(piece: Uint8Array): void {
    if (this.binary) {
      this.fill(piece);
      return;
    }
    this.head = joined(this.head, piece);
    this.readHead();
  }

  private readHead(): void {
    if (this.head.length < headerBytes) return;
    const view = new DataView(this.head.buffer, this.head.byteOffset, this.head.byteLength);
    if (this.jsonBytes < 0) {
      if (view.getUint32(0, true) !== magic || view.getUint32(4, true) !== 2) {
        throw new Error('This is not a GLB file of version 2.');
      }
      const bytes = view.getUint32(12, true);
      if (view.getUint32(16, true) !== jsonChunk || bytes > largestJson) {
        throw new Error('The GLB file does not begin with a JSON chunk.');
      }
      if (this.head.length < headerBytes + bytes) return;
      this.jsonBytes = bytes;
      const text = new TextDecoder().decode(this.head.subarray(headerBytes, headerBytes + bytes));
      this.primitives = primitivesOf(JSON.parse(text) as Gltf);
      const end = (part: number): number => {
        const { offset, length } = this.primitives[part] ?? { offset: 0, length: 0 };
        return offset + length;
      };
      this.order = this.primitives.map((_, index) => index).sort((a, b) => end(a) - end(b));
      this.listener.onPrimitives(this.primitives);
    }
    const start = headerBytes + this.jsonBytes;
    if (this.primitives.length === 0 || this.head.length < start + chunkHeaderBytes) return;
    const bytes = view.getUint32(start, true);
    if (view.getUint32(start + 4, true) !== binaryChunk) {
      throw new Error('The GLB file has no binary chunk.');
    }
    if (this.primitives.some((part) => part.offset + part.length > bytes)) {
      throw new Error('The GLB file refers to bytes that it does not hold.');
    }
    this.binary = new Uint8Array(bytes);
    const rest = this.head.subarray(start + chunkHeaderBytes);
    this.head = new Uint8Array(0);
    this.fill(rest);
  }

  private fill(piece: Uint8Array): void {
    const binary = this.binary;
    if (!binary) return;
    const wanted = piece.subarray(0, binary.length - this.filled);
    binary.set(wanted, this.filled);
    this.filled += wanted.length;
    for (;;) {
      const index = this.order[this.next] ?? -1;
      const part = this.primitives[index];
      if (!part || part.offset + part.length > this.filled) return;
      this.listener.onStream(index, gathered(binary, part.arrays?.ranges ?? [[part.offset, part.offset + part.length]]));
      this.next += 1;
    }
  }
}

// A copy of these bytes, one range behind the other.
function gathered(bytes: Uint8Array, ranges: readonly Range[]): Uint8Array<ArrayBuffer> {
  const copy = new Uint8Array(ranges.reduce((sum, [begin, end]) => sum + end - begin, 0));
  let filled = 0;
  for (const [begin, end] of ranges) {
    copy.set(bytes.subarray(begin, end), filled);
    filled += end - begin;
  }
  return copy;
}

function joined(a: Uint8Array, b: Uint8Array): Uint8Array {
  if (a.length === 0) return b;
  const all = new Uint8Array(a.length + b.length);
  all.set(a);
  all.set(b, a.length);
  return all;
}
