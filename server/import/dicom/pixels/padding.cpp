#include "server/import/dicom/pixels/padding.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

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

}  // namespace

std::optional<PaddingRange> padding_range(const DataSet& data, const PixelLayout& stored) {
  const Ends ends = ends_of(data, stored);
  if (!ends.value) return std::nullopt;
  // The limit may be on either side of the value.
  const double limit = ends.limit.value_or(*ends.value);
  return PaddingRange{std::min(*ends.value, limit), std::max(*ends.value, limit)};
}

void find_padding(const PaddingRange& padding, const PixelLayout& layout,
                  std::span<const std::byte> stored, std::uint64_t first, std::uint64_t total,
                  std::vector<bool>& found) {
  // Doubles represent all stored values.
  std::vector<double> values(layout.samples());
  convert_frame(stored, comparable(padding, layout), {}, SampleType::kFloat64,
                std::as_writable_bytes(std::span(values)));
  for (std::size_t at = 0; at < values.size(); ++at) {
    if (!(values[at] >= padding.first && values[at] <= padding.last)) continue;
    if (found.empty()) found.resize(total);
    found[first + at] = true;
  }
}

}  // namespace isomesh::import::dicom
