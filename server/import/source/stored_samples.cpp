#include "server/import/source/stored_samples.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kPieceSamples = std::size_t{1} << 17;

// True if the double equals its integer. A double of 2^63 or 2^64 must not be converted back,
// because the integer type cannot hold it.
template <class Stored>
bool is_exact(Stored stored, double value) {
  if constexpr (std::is_same_v<Stored, std::int64_t>) {
    return value < 0x1p63 && static_cast<Stored>(value) == stored;
  } else if constexpr (std::is_same_v<Stored, std::uint64_t>) {
    return value < 0x1p64 && static_cast<Stored>(value) == stored;
  } else {
    return true;
  }
}

template <class Stored>
double to_double(Stored stored) {
  const auto value = static_cast<double>(stored);
  if (!is_exact(stored, value)) {
    throw_unusable(
        "The 64-bit sample " + std::to_string(stored) +
        " is too large to be stored exactly. Labels of 64 bits are read if there are at most "
        "65535.");
  }
  return value;
}

template <class Stored, class Canonical>
void convert(std::span<const std::byte> stored, const Rescale& rescale, std::byte* target) {
  for (std::size_t at = 0; at < stored.size(); at += sizeof(Stored)) {
    Stored sample;
    std::memcpy(&sample, stored.data() + at, sizeof(Stored));
    const double value = to_double(sample) * rescale.slope + rescale.intercept;
    // Values beyond the largest float become infinite, and the volume is rejected later.
    const auto canonical = static_cast<Canonical>(value);
    std::memcpy(target, &canonical, sizeof(Canonical));
    target += sizeof(Canonical);
  }
}

void convert_piece(std::span<const std::byte> stored, const SampleLayout& layout,
                   std::span<std::byte> target) {
  const Rescale rescale = layout.rescale.value_or(Rescale{});
  with_stored_sample(layout.type, [&](auto sample) {
    using Stored = decltype(sample);
    if (canonical_type(layout) == SampleType::kFloat32) {
      convert<Stored, float>(stored, rescale, target.data());
    } else {
      convert<Stored, double>(stored, rescale, target.data());
    }
  });
}

bool is_converted(const SampleLayout& layout) {
  return layout.rescale || layout.type == StoredType::kUint64 || layout.type == StoredType::kInt64;
}

void read_exactly(const InputFile& file, std::uint64_t offset, std::span<std::byte> target) {
  if (file.read(offset, target) != target.size()) {
    throw_unusable("The file ends before its last sample.");
  }
}

float float_of_half(std::uint16_t half) {
  constexpr int kBias = 15;
  constexpr int kFractionBits = 10;
  const int exponent = half >> kFractionBits & 0x1f;
  const int fraction = half & 0x3ff;
  const float sign = (half & 0x8000) != 0 ? -1.0F : 1.0F;
  if (exponent == 0x1f) {
    return fraction != 0 ? std::numeric_limits<float>::quiet_NaN()
                         : sign * std::numeric_limits<float>::infinity();
  }
  if (exponent == 0)
    return sign * std::ldexp(static_cast<float>(fraction), 1 - kBias - kFractionBits);
  return sign * std::ldexp(static_cast<float>(fraction + 1024), exponent - kBias - kFractionBits);
}

}  // namespace

std::size_t bytes_per_sample(StoredType type) {
  return with_stored_sample(type, [](auto sample) { return sizeof(sample); });
}

StoredType stored_type(SampleType type) { return static_cast<StoredType>(type); }

SampleType canonical_type(const SampleLayout& layout) {
  return with_stored_sample(layout.type, [&](auto sample) {
    using Stored = decltype(sample);
    constexpr bool kIsWideInteger = std::is_integral_v<Stored> && sizeof(Stored) == 8;
    constexpr bool kFitsFloat =
        sizeof(Stored) <= 2 || (std::is_floating_point_v<Stored> && sizeof(Stored) == 4);
    if (!kIsWideInteger && !layout.rescale) return static_cast<SampleType>(layout.type);
    return kFitsFloat ? SampleType::kFloat32 : SampleType::kFloat64;
  });
}

void floats_of_halves(std::span<const std::uint16_t> halves, std::span<float> target) {
  std::ranges::transform(halves, target.begin(), float_of_half);
}

void swap_bytes(std::span<std::byte> bytes, std::size_t bytes_per_sample) {
  const auto swap_as = [&](auto sample) {
    for (std::size_t at = 0; at < bytes.size(); at += sizeof(sample)) {
      std::memcpy(&sample, bytes.data() + at, sizeof(sample));
      if constexpr (sizeof(sample) == 2) sample = __builtin_bswap16(sample);
      if constexpr (sizeof(sample) == 4) sample = __builtin_bswap32(sample);
      if constexpr (sizeof(sample) == 8) sample = __builtin_bswap64(sample);
      std::memcpy(bytes.data() + at, &sample, sizeof(sample));
    }
  };
  if (bytes_per_sample == 2) swap_as(std::uint16_t{});
  if (bytes_per_sample == 4) swap_as(std::uint32_t{});
  if (bytes_per_sample == 8) swap_as(std::uint64_t{});
}

void read_samples(const InputFile& file, std::uint64_t offset, const SampleLayout& layout,
                  std::span<std::byte> target) {
  const std::size_t stored_size = bytes_per_sample(layout.type);
  const std::size_t canonical_size = isomesh::bytes_per_sample(canonical_type(layout));
  const bool converted = is_converted(layout);
  std::vector<std::byte> buffer(converted ? kPieceSamples * stored_size : 0);
  while (!target.empty()) {
    const std::size_t count = std::min(kPieceSamples, target.size() / canonical_size);
    const std::span piece = target.first(count * canonical_size);
    const std::span stored = converted ? std::span(buffer).first(count * stored_size) : piece;
    read_exactly(file, offset, stored);
    if (layout.big_endian) swap_bytes(stored, stored_size);
    if (converted) convert_piece(stored, layout, piece);
    offset += stored.size();
    target = target.subspan(piece.size());
  }
}

}  // namespace isomesh::import
