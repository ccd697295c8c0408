// Checks of the sizes that headers and requests tell.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "proto/types.h"

namespace isomesh::volume {

struct SizeLimits {
  std::uint64_t max_sample_bytes = std::uint64_t{16} << 30;  // of a volume's samples
};

// The three sizes of a volume, from those that a header tells along its first axes, three at most;
// missing ones are 1. Throws Error kUnusableVolume for a size of 0, or so many samples that their
// bytes cannot be counted.
std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes);

// Throws Error kTooLarge when the canonical samples would exceed the limits. `sample_count` is one
// whose bytes can be counted.
void check_limits(std::uint64_t sample_count, SampleType type, const SizeLimits& limits);

// Checks a request's description before there is a file. Throws Error kInvalidParameter when it
// does not describe a volume, kTooLarge beyond the limits.
void check_raw(const RawDescription& description, const SizeLimits& limits);

}  // namespace isomesh::volume
