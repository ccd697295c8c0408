#include "server/import/samples/wide_labels.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "proto/samples.h"
#include "server/volume/canonical.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kWidePieceSamples = std::size_t{1} << 16;
// The smallest fraction of equal neighbours, not counting pairs of background, as of other labels.
constexpr double kFlat = 0.6;

// Calls take(pieces of samples) from the first to the last, until it returns false.
template <class Stored, class Take>
void for_each_piece(const PlainSamples& samples, std::uint64_t count, const Take& take) {
  std::vector<Stored> piece;
  std::uint64_t offset = samples.offset;
  while (count > 0) {
    piece.resize(static_cast<std::size_t>(std::min<std::uint64_t>(count, kWidePieceSamples)));
    const auto bytes = std::as_writable_bytes(std::span(piece));
    if (samples.file.read(offset, bytes) != bytes.size()) {
      throw_unusable("The file ends before its last sample.");
    }
    if (samples.layout.big_endian) swap_bytes(bytes, sizeof(Stored));
    if (!take(std::span<const Stored>(piece))) return;
    offset += bytes.size();
    count -= piece.size();
  }
}

template <class Stored>
bool is_wide(Stored value) {
  if constexpr (std::is_signed_v<Stored>) {
    if (value < std::numeric_limits<std::int32_t>::min()) return true;
  }
  return value > Stored{std::numeric_limits<std::uint32_t>::max()};
}

// The values of samples, until they are too many to be labels, and how flat their regions are.
template <class Stored>
class Survey {
 public:
  bool take(std::span<const Stored> piece) {
    for (const Stored value : piece) {
      if (is_begun_ && value == last_) {
        pairs_ += value == 0 ? 0 : 1;
        same_ += value == 0 ? 0 : 1;
        continue;
      }
      pairs_ += is_begun_ ? 1 : 0;
      is_begun_ = true;
      last_ = value;
      has_wide_ = has_wide_ || is_wide(value);
      if (value != 0) numbers_.try_emplace(value, 0);
      if (numbers_.size() > Volume::kMostLabels) return false;
    }
    return true;
  }

  bool may_be_labels() const { return has_wide_ && numbers_.size() <= Volume::kMostLabels; }
  bool is_flat() const { return static_cast<double>(same_) >= kFlat * static_cast<double>(pairs_); }

  // The values in ascending order, each with its number from then on.
  std::vector<Stored> number_values() {
    std::vector<Stored> values;
    for (const auto& [value, number] : numbers_) values.push_back(value);
    std::ranges::sort(values);
    for (std::size_t at = 0; at < values.size(); ++at) {
      numbers_[values[at]] = static_cast<std::uint32_t>(at + 1);
    }
    return values;
  }

  std::uint32_t number_of(Stored value) const {
    return value == 0 ? 0 : numbers_.find(value)->second;
  }

 private:
  std::unordered_map<Stored, std::uint32_t> numbers_;
  Stored last_ = 0;
  bool is_begun_ = false;
  bool has_wide_ = false;
  std::uint64_t pairs_ = 0;  // of neighbours that are not both background
  std::uint64_t same_ = 0;
};

// Keeps what the volume's table says of labels that there are.
template <class Stored>
std::vector<LabelEntry> entries_of(const std::vector<Stored>& values,
                                   const std::vector<LabelEntry>& told) {
  std::vector<LabelEntry> entries;
  for (std::size_t at = 0; at < values.size(); ++at) {
    const auto label = static_cast<std::int64_t>(values[at]);
    const auto known = std::ranges::lower_bound(told, label, {}, &LabelEntry::label);
    LabelEntry& entry = entries.emplace_back();
    if (known != told.end() && known->label == label) entry = *known;
    entry.label = label;
    entry.values = {static_cast<std::int64_t>(at + 1)};
  }
  return entries;
}

Note renumbered_note(std::size_t labels) {
  return note_of(NoteCode::kLabelsRenumbered,
                 "The labels are integers of 64 bits, which samples cannot hold. The samples have "
                 "the numbers from 1 to " +
                     std::to_string(labels) +
                     " instead, in the order of the labels. Lists, names of files and meshes have "
                     "the labels of the file.");
}

template <class Stored>
std::optional<Volume> write(const PlainSamples& samples, Volume volume,
                            const std::filesystem::path& target) {
  Survey<Stored> survey;
  for_each_piece<Stored>(samples, volume.sample_count(),
                         [&](std::span<const Stored> piece) { return survey.take(piece); });
  const bool is_declared = samples.are_labels || !volume.labels.empty();
  if (!survey.may_be_labels() || (!is_declared && !survey.is_flat())) return std::nullopt;
  const std::vector<Stored> values = survey.number_values();
  if (!std::in_range<std::int64_t>(values.back())) {
    throw_unusable("The label " + std::to_string(values.back()) +
                   " is too large: labels up to 9223372036854775807 are read. Number the labels "
                   "anew and upload them again.");
  }
  volume.labels = entries_of(values, volume.labels);
  volume.type = values.size() <= std::numeric_limits<std::uint8_t>::max() ? SampleType::kUint8
                                                                          : SampleType::kUint16;
  CanonicalWriter writer(target, {volume.dims, volume.type, volume.geometry});
  std::byte* to = writer.samples().data();
  with_sample(volume.type, [&](auto number) {
    for_each_piece<Stored>(samples, volume.sample_count(), [&](std::span<const Stored> piece) {
      for (const Stored value : piece) {
        if constexpr (std::is_integral_v<decltype(number)>) {
          number = static_cast<decltype(number)>(survey.number_of(value));
        }
        std::memcpy(to, &number, sizeof(number));
        to += sizeof(number);
      }
      return true;
    });
  });
  volume.notes.push_back(renumbered_note(values.size()));
  return finish(writer, std::move(volume));
}

}  // namespace

std::optional<Volume> write_wide_labels(const PlainSamples& samples, const Volume& volume,
                                        const std::filesystem::path& target) {
  if (samples.layout.rescale) return std::nullopt;
  if (samples.layout.type == StoredType::kUint64) {
    return write<std::uint64_t>(samples, volume, target);
  }
  if (samples.layout.type == StoredType::kInt64)
    return write<std::int64_t>(samples, volume, target);
  return std::nullopt;
}

}  // namespace isomesh::import
