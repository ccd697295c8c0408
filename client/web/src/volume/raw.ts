// Raw samples: what their size says about them.
import type { SampleType } from '../api/types';

export const sampleArrays = {
  uint8: Uint8Array,
  int8: Int8Array,
  uint16: Uint16Array,
  int16: Int16Array,
  uint32: Uint32Array,
  int32: Int32Array,
  float32: Float32Array,
  float64: Float64Array,
} as const satisfies Record<SampleType, unknown>;

// The fault of a description; empty if it accounts for every byte.
export function rawFault(size: number, dims: readonly number[], type: SampleType): string {
  if (dims.length !== 3 || !dims.every((count) => Number.isInteger(count) && count > 0)) {
    return 'Enter a positive whole number for each axis.';
  }
  const described = dims.reduce((a, b) => a * b, sampleArrays[type].BYTES_PER_ELEMENT);
  if (described === size) return '';
  return `These values describe ${described} bytes, but the file has ${size}.`;
}
