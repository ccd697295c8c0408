// Samples as files hold them -> samples as canonical volumes hold them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "proto/types.h"
#include "server/volume/files.h"

namespace isomesh::volume {

// The type of one sample in a file: those of canonical volumes and the two that are converted.
enum class StoredType {
  kUint8,
  kInt8,
  kUint16,
  kInt16,
  kUint32,
  kInt32,
  kFloat32,
  kFloat64,
  kUint64,
  kInt64,
};

std::size_t bytes_per_sample(StoredType type);
StoredType stored_type(SampleType type);

// What a sample means: stored * slope + intercept.
struct Rescale {
  double slope = 1;
  double intercept = 0;
};

struct SampleLayout {
  StoredType type = StoredType::kUint8;
  bool big_endian = false;
  std::optional<Rescale> rescale;  // empty: samples mean what is stored
};

// What the samples become. Rescaled ones become float32 where that holds every stored value
// (integers of up to 16 bits, float32) and float64 otherwise; 64-bit integers become float64.
SampleType canonical_type(const SampleLayout& layout);

// Reads samples from `offset` of the file on into `target`, which tells by its size how many there
// are; converts them on the way, with bounded memory.
// Throws Error kUnusableVolume when the file ends early or a 64-bit integer is not exact in
// float64.
void read_samples(const InputFile& file, std::uint64_t offset, const SampleLayout& layout,
                  std::span<std::byte> target);

// Turns the byte order of every sample around; `bytes` holds whole samples.
void swap_bytes(std::span<std::byte> bytes, std::size_t bytes_per_sample);

// Calls `use` with a value-initialised sample of the type, for its static type.
template <class Use>
void with_sample(StoredType type, Use&& use) {
  switch (type) {
    case StoredType::kUint8:
      return use(std::uint8_t{});
    case StoredType::kInt8:
      return use(std::int8_t{});
    case StoredType::kUint16:
      return use(std::uint16_t{});
    case StoredType::kInt16:
      return use(std::int16_t{});
    case StoredType::kUint32:
      return use(std::uint32_t{});
    case StoredType::kInt32:
      return use(std::int32_t{});
    case StoredType::kFloat32:
      return use(float{});
    case StoredType::kFloat64:
      return use(double{});
    case StoredType::kUint64:
      return use(std::uint64_t{});
    case StoredType::kInt64:
      return use(std::int64_t{});
  }
}

}  // namespace isomesh::volume
