// Raw samples: what their size says about them.
import type { SampleType } from '../api/types';

export const sampleBytes: Record<SampleType, number> = {
  uint8: 1,
  int8: 1,
  uint16: 2,
  int16: 2,
  uint32: 4,
  int32: 4,
  float32: 4,
  float64: 8,
};

// The fault of a description; empty if it accounts for every byte.
export function rawFault(size: number, dims: readonly number[], type: SampleType): string {
  if (dims.length !== 3 || !dims.every((count) => Number.isInteger(count) && count > 0)) {
    return 'Enter a positive whole number for each axis.';
  }
  const described = dims.reduce((a, b) => a * b, sampleBytes[type]);
  if (described === size) return '';
  return `These values describe ${described} bytes, but the file has ${size}.`;
}
