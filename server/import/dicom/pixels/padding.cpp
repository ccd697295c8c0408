#include "server/import/dicom/pixels/padding.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "proto/samples.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/pixels/values.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import::dicom {
namespace {

template <class Stored>
std::optional<double> number_of(const DataSet& data, Tag tag) {
  const Element* element = data.find(tag);
  if (element == nullptr || element->value.size() != sizeof(Stored)) return std::nullopt;
  return HeaderBytes(element->value, data.big_endian).at<Stored>(0);
}

// The standard has words of 16 bits. Some programs write 32 bits for samples of that size.
std::optional<double> integer_of(const DataSet& data, Tag tag, bool is_signed) {
  const auto word =
      is_signed ? number_of<std::int16_t>(data, tag) : number_of<std::uint16_t>(data, tag);
  if (word) return word;
  return is_signed ? number_of<std::int32_t>(data, tag) : number_of<std::uint32_t>(data, tag);
}

struct Ends {
  std::optional<double> value;
  std::optional<double> limit;  // without one, the value alone is padding
};

Ends ends_of(const DataSet& data, const PixelLayout& stored) {
  if (stored.is_float && stored.bits_allocated == 32) {
    return {number_of<float>(data, kFloatPixelPaddingValue),
            number_of<float>(data, kFloatPixelPaddingRangeLimit)};
  }
  if (stored.is_float) {
    return {number_of<double>(data, kDoubleFloatPixelPaddingValue),
            number_of<double>(data, kDoubleFloatPixelPaddingRangeLimit)};
  }
  return {integer_of(data, kPixelPaddingValue, stored.is_signed),
          integer_of(data, kPixelPaddingRangeLimit, stored.is_signed)};
}

// Some programs mark padding with bits above those of the samples. Then the whole words are equal.
PixelLayout comparable(const PaddingRange& padding, PixelLayout layout) {
  if (layout.is_float) return layout;
  const double count = std::pow(2, layout.bits_stored);
  const double least = layout.is_signed ? -count / 2 : 0;
  if (padding.last >= least && padding.first < least + count) return layout;
  layout.bits_stored = layout.bits_allocated;
  layout.high_bit = layout.bits_stored - 1;
  return layout;
}

// The values are of a type that holds all stored ones.
template <class Value>
void find_values(const PaddingRange& padding, const PixelLayout& layout,
                 std::span<const std::byte> stored, std::uint64_t first, SampleSet& found) {
  std::vector<Value> values(layout.samples());
  convert_frame(stored, layout, {}, sample_type<Value>(),
                std::as_writable_bytes(std::span(values)));
  const auto low = static_cast<Value>(padding.first);
  const auto high = static_cast<Value>(padding.last);
  for (std::size_t at = 0; at < values.size(); ++at) {
    if (values[at] >= low && values[at] <= high) found.add(first + at);
  }
}

}  // namespace

std::optional<PaddingRange> padding_range(const DataSet& data, const PixelLayout& stored) {
  const Ends ends = ends_of(data, stored);
  if (!ends.value) return std::nullopt;
  // The limit may be on either side of the value.
  const double limit = ends.limit.value_or(*ends.value);
  return PaddingRange{std::min(*ends.value, limit), std::max(*ends.value, limit)};
}

void find_padding(const PaddingRange& padding, const PixelLayout& layout,
                  std::span<const std::byte> stored, std::uint64_t first, SampleSet& found) {
  const PixelLayout compared = comparable(padding, layout);
  // A value of 32 bits would not fit into an integer, and may be the padding of samples of 16.
  const bool is_short = !layout.is_float && layout.bits_allocated <= 16 &&
                        std::max(std::abs(padding.first), std::abs(padding.last)) <= 0x1p30;
  if (is_short) return find_values<std::int32_t>(padding, compared, stored, first, found);
  find_values<double>(padding, compared, stored, first, found);
}

}  // namespace isomesh::import::dicom
