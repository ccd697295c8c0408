#include "server/import/dicom/pixels/values.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "proto/samples.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

// Products of such factors and 32-bit samples are exact in 64 bits.
constexpr double kLargestFactor = 0x1p30;

bool is_integral(double value) {
  return std::abs(value) <= kLargestFactor && std::floor(value) == value;
}

bool is_integral(const Rescale& rescale) {
  return is_integral(rescale.slope) && is_integral(rescale.intercept);
}

struct Range {
  std::int64_t low = 0;
  std::int64_t high = 0;
};

Range stored_range(const PixelLayout& layout) {
  const std::int64_t count = std::int64_t{1} << layout.bits_stored;
  return layout.is_signed ? Range{-count / 2, count / 2 - 1} : Range{0, count - 1};
}

Range value_range(const PixelLayout& layout, const Rescale& rescale) {
  const auto slope = static_cast<std::int64_t>(rescale.slope);
  const auto intercept = static_cast<std::int64_t>(rescale.intercept);
  const Range stored = stored_range(layout);
  const std::int64_t one = stored.low * slope + intercept;
  const std::int64_t other = stored.high * slope + intercept;
  return {std::min(one, other), std::max(one, other)};
}

// True if no two stored values become equal: float32 numbers of this size are at most 2^-23 of it
// apart.
bool differ_in_float32(const PixelLayout& layout, const Rescale& rescale) {
  const auto size_of = [&](std::int64_t stored) {
    return std::abs(static_cast<double>(stored) * rescale.slope + rescale.intercept);
  };
  const Range stored = stored_range(layout);
  return std::max(size_of(stored.low), size_of(stored.high)) <= std::abs(rescale.slope) * 0x1p23;
}

bool fits_float32(const PixelLayout& layout, const Rescale& rescale) {
  if (layout.is_float) return layout.bits_allocated <= 32;
  return layout.bits_allocated <= 16 && differ_in_float32(layout, rescale);
}

struct IntegerType {
  SampleType type;
  Range range;
};

template <class Integer>
constexpr IntegerType integer_type() {
  return {sample_type<Integer>(),
          {std::numeric_limits<Integer>::min(), std::numeric_limits<Integer>::max()}};
}

constexpr IntegerType kIntegerTypes[] = {
    integer_type<std::uint8_t>(), integer_type<std::int8_t>(),  integer_type<std::uint16_t>(),
    integer_type<std::int16_t>(), integer_type<std::int32_t>(), integer_type<std::uint32_t>(),
};

std::vector<SampleType> integer_candidates(const Range& values, unsigned bits_allocated) {
  std::vector<SampleType> candidates;
  for (const IntegerType& each : kIntegerTypes) {
    if (bytes_per_sample(each.type) < bits_allocated / 8) continue;
    if (each.range.low <= values.low && values.high <= each.range.high) {
      candidates.push_back(each.type);
      return candidates;
    }
    if (each.type == SampleType::kInt16 && bits_allocated == 16) candidates.push_back(each.type);
  }
  candidates.push_back(SampleType::kFloat64);
  return candidates;
}

template <class Stored, class Value>
bool convert(std::span<const std::byte> stored, const PixelLayout& layout, const Rescale& rescale,
             std::byte* target) {
  const unsigned shift = layout.high_bit + 1 - layout.bits_stored;
  const std::uint64_t mask = (std::uint64_t{1} << layout.bits_stored) - 1;
  const std::uint64_t sign = layout.is_signed ? std::uint64_t{1} << (layout.bits_stored - 1) : 0;
  const bool integral = is_integral(rescale);
  const auto slope = integral ? static_cast<std::int64_t>(rescale.slope) : 0;
  const auto intercept = integral ? static_cast<std::int64_t>(rescale.intercept) : 0;
  for (std::size_t at = 0; at < stored.size(); at += sizeof(Stored), target += sizeof(Value)) {
    Stored word;
    std::memcpy(&word, stored.data() + at, sizeof(Stored));
    const std::uint64_t bits = std::uint64_t{word} >> shift & mask;
    const auto sample = static_cast<std::int64_t>(bits ^ sign) - static_cast<std::int64_t>(sign);
    Value value{};
    if constexpr (std::is_integral_v<Value>) {
      const std::int64_t exact = sample * slope + intercept;
      if (!std::in_range<Value>(exact)) return false;
      value = static_cast<Value>(exact);
    } else {
      // Values beyond the largest float become infinite, and the volume is rejected later.
      value = static_cast<Value>(static_cast<double>(sample) * rescale.slope + rescale.intercept);
    }
    std::memcpy(target, &value, sizeof(Value));
  }
  return true;
}

template <class Stored, class Value>
bool convert_reals(std::span<const std::byte> stored, const Rescale& rescale, std::byte* target) {
  for (std::size_t at = 0; at < stored.size(); at += sizeof(Stored), target += sizeof(Value)) {
    Stored sample;
    std::memcpy(&sample, stored.data() + at, sizeof(Stored));
    const auto value = static_cast<Value>(sample * rescale.slope + rescale.intercept);
    std::memcpy(target, &value, sizeof(Value));
  }
  return true;
}

template <class Value>
bool convert_to(std::span<const std::byte> stored, const PixelLayout& layout,
                const Rescale& rescale, std::byte* target) {
  if constexpr (std::is_floating_point_v<Value>) {
    if (layout.is_float && layout.bits_allocated == 32) {
      return convert_reals<float, Value>(stored, rescale, target);
    }
    if (layout.is_float) return convert_reals<double, Value>(stored, rescale, target);
  }
  switch (layout.bits_allocated) {
    case 8:
      return convert<std::uint8_t, Value>(stored, layout, rescale, target);
    case 16:
      return convert<std::uint16_t, Value>(stored, layout, rescale, target);
    default:
      return convert<std::uint32_t, Value>(stored, layout, rescale, target);
  }
}

// --- Tables --------------------------------------------------------------------------------------

[[noreturn]] void throw_table(const std::string& reason) {
  throw_unusable("The DICOM image defines the values of its samples by a lookup table " +
                 tag_name(kModalityLutSequence) + ", which cannot be used: " + reason + '.');
}

// Entries of 8 bits fill a word each, or, in files of some programs, a byte each.
std::vector<std::uint16_t> entries_of(const DataSet& item, std::size_t count) {
  const Element* data = item.find(kLutData);
  const std::size_t bytes = data == nullptr ? 0 : data->value.size();
  std::vector<std::uint16_t> entries;
  if (bytes >= count * 2) {
    for (const std::uint32_t entry : item.unsigned_numbers(kLutData)) {
      entries.push_back(static_cast<std::uint16_t>(entry));
    }
  } else if (bytes >= count && !item.big_endian) {
    for (const char entry : data->value) entries.push_back(static_cast<unsigned char>(entry));
  }
  if (entries.size() < count) {
    throw_table("it has " + std::to_string(bytes) + " bytes for " + std::to_string(count) +
                " entries");
  }
  entries.resize(count);
  return entries;
}

}  // namespace

std::vector<SampleType> candidate_types(std::span<const Slice> slices) {
  unsigned bits_allocated = 0;
  bool integral = true;
  bool fits_float = true;
  for (const Slice& slice : slices) {
    const PixelLayout& layout = slice.image->layout;
    bits_allocated = std::max(bits_allocated, layout.bits_allocated);
    integral = integral && !layout.is_float && is_integral(slice.frame->rescale);
    fits_float = fits_float && fits_float32(layout, slice.frame->rescale);
  }
  if (!integral) return {fits_float ? SampleType::kFloat32 : SampleType::kFloat64};
  Range all = value_range(slices.front().image->layout, slices.front().frame->rescale);
  for (const Slice& slice : slices) {
    const Range values = value_range(slice.image->layout, slice.frame->rescale);
    all = {std::min(all.low, values.low), std::max(all.high, values.high)};
  }
  return integer_candidates(all, bits_allocated);
}

bool convert_frame(std::span<const std::byte> stored, const PixelLayout& layout,
                   const Rescale& rescale, SampleType type, std::span<std::byte> target) {
  return with_sample(type, [&](auto sample) {
    return convert_to<decltype(sample)>(stored, layout, rescale, target.data());
  });
}

std::optional<ValueTable> value_table(const DataSet& data, const PixelLayout& stored) {
  const DataSet* item = data.item(kModalityLutSequence);
  if (item == nullptr) return std::nullopt;
  if (stored.is_float || (stored.bits_allocated != 8 && stored.bits_allocated != 16)) {
    throw_table("the samples are not integers of 8 or 16 bits");
  }
  constexpr std::size_t kMostEntries = std::size_t{1} << 16;
  const std::vector<std::uint32_t> descriptor = item->unsigned_numbers(kLutDescriptor);
  if (descriptor.size() != 3) throw_table("its descriptor does not have three numbers");
  const auto first = static_cast<std::uint16_t>(descriptor[1]);
  return ValueTable{
      .first = stored.is_signed ? static_cast<std::int16_t>(first) : std::int64_t{first},
      .values = entries_of(*item, descriptor[0] == 0 ? kMostEntries : descriptor[0])};
}

void apply_table(const ValueTable& table, const PixelLayout& layout,
                 std::span<const std::byte> stored, std::span<std::byte> target) {
  std::vector<std::int32_t> values(layout.samples());
  convert_frame(stored, layout, {}, SampleType::kInt32, std::as_writable_bytes(std::span(values)));
  const auto last = static_cast<std::int64_t>(table.values.size()) - 1;
  for (std::size_t at = 0; at < values.size(); ++at) {
    const std::int64_t entry = std::clamp<std::int64_t>(values[at] - table.first, 0, last);
    const std::uint16_t value = table.values[static_cast<std::size_t>(entry)];
    std::memcpy(target.data() + at * sizeof(value), &value, sizeof(value));
  }
}

}  // namespace isomesh::import::dicom
