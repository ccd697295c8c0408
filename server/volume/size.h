// Validates sizes from headers and requests.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "proto/types.h"

namespace isomesh::volume {

struct SizeLimits {
  std::uint64_t max_sample_bytes = std::uint64_t{16} << 30;  // of a volume's samples
};

// The three sizes of a volume, from at most three in a header; missing ones are 1. Throws Error
// kUnusableVolume for a size of 0, or if the number of bytes overflows.
std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes);

// Throws Error kTooLarge if the canonical samples would exceed the limits. The bytes of
// `sample_count` samples must not overflow.
void check_limits(std::uint64_t sample_count, SampleType type, const SizeLimits& limits);

// Validates a request's description in advance. Throws Error kInvalidParameter if it is not that of
// a volume, kTooLarge beyond the limits.
void check_raw(const RawDescription& description, const SizeLimits& limits);

}  // namespace isomesh::volume
