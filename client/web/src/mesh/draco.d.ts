// The decoder that three.js brings has the interface of the package draco3d.
declare module 'three/examples/jsm/libs/draco/gltf/draco_wasm_wrapper.js' {
  export { createDecoderModule as default } from 'draco3d';
}
