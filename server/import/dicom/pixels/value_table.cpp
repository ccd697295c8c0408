#include "server/import/dicom/pixels/value_table.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/pixels/values.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

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
