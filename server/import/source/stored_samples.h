// Samples as stored in files -> samples of canonical volumes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/files.h"
#include "proto/samples.h"
#include "proto/types.h"

namespace isomesh::import {

// The type of a sample in a file: the types of canonical volumes, with the same names and numbers,
// and two more that are converted.
enum class StoredType {
#define ISOMESH_NAME(Sample, name, kType) kType = static_cast<int>(SampleType::kType),
  ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_NAME)
#undef ISOMESH_NAME
      kUint64,
  kInt64,
};

// Calls `use` as with_sample does.
template <class Use>
decltype(auto) with_stored_sample(StoredType type, Use&& use) {
  if (type == StoredType::kUint64) return use(std::uint64_t{});
  if (type == StoredType::kInt64) return use(std::int64_t{});
  return with_sample(static_cast<SampleType>(type), use);
}

std::size_t bytes_per_sample(StoredType type);
StoredType stored_type(SampleType type);

// The meaning of a sample: stored * slope + intercept.
struct Rescale {
  double slope = 1;
  double intercept = 0;

  bool operator==(const Rescale&) const = default;
};

struct SampleLayout {
  StoredType type = StoredType::kUint8;
  bool big_endian = false;
  std::optional<Rescale> rescale;  // empty: stored values are final
};

// The canonical type. Rescaled samples become float32 if that represents every stored value
// (integers of up to 16 bits, float32), otherwise float64; 64-bit integers become float64.
SampleType canonical_type(const SampleLayout& layout);

// Reads samples from `offset` until `target` is full, converted to their canonical type, with
// bounded memory. Throws Error kUnusableVolume if the file ends early or a 64-bit integer is not
// exact in float64.
void read_samples(const InputFile& file, std::uint64_t offset, const SampleLayout& layout,
                  std::span<std::byte> target);

// The values of floats of 16 bits (IEEE 754 binary16). `target` has as many samples.
void floats_of_halves(std::span<const std::uint16_t> halves, std::span<float> target);

// Reverses the bytes of each sample; `bytes` holds whole samples.
void swap_bytes(std::span<std::byte> bytes, std::size_t bytes_per_sample);

}  // namespace isomesh::import
