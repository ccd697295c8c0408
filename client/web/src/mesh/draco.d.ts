// The part of Draco's decoder (its JavaScript binding) that is called here.
declare module 'three/examples/jsm/libs/draco/gltf/draco_wasm_wrapper.js' {
  export interface DracoStatus {
    ok(): boolean;
    error_msg(): string;
  }
  export interface DracoMesh {
    ptr: number;
    num_points(): number;
    num_faces(): number;
  }
  export interface DracoAttribute {
    ptr: number;
  }
  export interface DracoBuffer {
    Init(bytes: Int8Array | Uint8Array, length: number): void;
  }
  export interface DracoDecoder {
    DecodeBufferToMesh(buffer: DracoBuffer, mesh: DracoMesh): DracoStatus;
    GetAttributeByUniqueId(mesh: DracoMesh, id: number): DracoAttribute;
    GetAttributeId(mesh: DracoMesh, type: number): number;
    GetAttribute(mesh: DracoMesh, id: number): DracoAttribute;
    GetTrianglesUInt32Array(mesh: DracoMesh, bytes: number, pointer: number): boolean;
    GetAttributeDataArrayForAllPoints(
      mesh: DracoMesh,
      attribute: DracoAttribute,
      type: number,
      bytes: number,
      pointer: number,
    ): boolean;
  }
  export interface DracoModule {
    Decoder: new () => DracoDecoder;
    DecoderBuffer: new () => DracoBuffer;
    Mesh: new () => DracoMesh;
    POSITION: number;
    DT_FLOAT32: number;
    HEAPF32: Float32Array;
    HEAPU32: Uint32Array;
    _malloc(bytes: number): number;
    _free(pointer: number): void;
    destroy(object: object): void;
  }
  export default function create(options: { wasmBinary: ArrayBuffer }): Promise<DracoModule>;
}
