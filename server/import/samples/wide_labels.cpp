#include "server/import/samples/wide_labels.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "proto/samples.h"
#include "server/import/labels/closed_ends.h"
#include "server/volume/canonical.h"
#include "server/volume/geometry.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kWidePieceSamples = std::size_t{1} << 16;
// The smallest fraction of equal neighbours, not counting pairs of background, as of other labels.
constexpr double kFlat = 0.6;

// Reads as many samples as `piece` has, from the sample `first` on.
template <class Stored>
void read_piece(const PlainSamples& samples, std::uint64_t first, std::vector<Stored>& piece) {
  const auto bytes = std::as_writable_bytes(std::span(piece));
  if (samples.file.read(samples.offset + first * sizeof(Stored), bytes) != bytes.size()) {
    throw_unusable("The file ends before its last sample.");
  }
  if (samples.layout.big_endian) swap_bytes(bytes, sizeof(Stored));
}

// Calls take(pieces of samples) from the first to the last, until it returns false.
template <class Stored, class Take>
void for_each_piece(const PlainSamples& samples, std::uint64_t count, const Take& take) {
  std::vector<Stored> piece;
  for (std::uint64_t first = 0; first < count; first += piece.size()) {
    piece.resize(
        static_cast<std::size_t>(std::min<std::uint64_t>(count - first, kWidePieceSamples)));
    read_piece(samples, first, piece);
    if (!take(std::span<const Stored>(piece))) return;
  }
}

// The range of samples.
template <class Stored>
struct Survey {
  Stored least = std::numeric_limits<Stored>::max();
  Stored most = std::numeric_limits<Stored>::min();

  void take(std::span<const Stored> piece) {
    for (const Stored value : piece) {
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }

  // No type of 32 bits has all samples.
  bool is_wide() const {
    const auto fits = [&]<class Narrow>(Narrow) {
      return std::in_range<Narrow>(least) && std::in_range<Narrow>(most);
    };
    return !fits(std::int32_t{}) && !fits(std::uint32_t{});
  }
};

// The different values other than 0, ascending, until they are too many to be labels. They are
// sorted, because a hash table would be slow for values that its hash puts into one place.
template <class Stored>
class Values {
 public:
  bool take(std::span<const Stored> piece) {
    for (const Stored value : piece) {
      if (value == 0 || (!values_.empty() && value == values_.back())) continue;
      values_.push_back(value);
      if (values_.size() >= kMostUnsorted && !sort()) return false;
    }
    return true;
  }

  // Returns false if there are too many.
  bool sort() {
    std::ranges::sort(values_);
    // Clang 14 cannot compile std::ranges::unique of g++ 12.
    values_.erase(std::unique(values_.begin(), values_.end()), values_.end());
    return values_.size() <= Volume::kMostLabels;
  }

  const std::vector<Stored>& all() const { return values_; }

 private:
  static constexpr std::size_t kMostUnsorted = std::size_t{8} * Volume::kMostLabels;

  std::vector<Stored> values_;
};

// The numbers of values: their places among `values`, from 1.
template <class Stored>
class Numbers {
 public:
  explicit Numbers(const std::vector<Stored>& values) : values_(values) {}

  std::uint32_t of(Stored value) {
    if (value != last_) {
      last_ = value;
      const auto place = std::ranges::lower_bound(values_, value);
      number_ = value == 0 ? 0 : static_cast<std::uint32_t>(place - values_.begin()) + 1;
    }
    return number_;
  }

 private:
  const std::vector<Stored>& values_;
  Stored last_ = 0;
  std::uint32_t number_ = 0;
};

// The share of neighbours that are equal along the patient's first axis, as
// volume::share_of_equal_neighbours() counts them in the canonical file.
template <class Stored>
double share_of_equal(const PlainSamples& samples, const Volume& volume) {
  const auto& dims = volume.dims;
  const volume::AxisOrder order = volume::canonical_order(volume.geometry);
  const std::array<std::uint64_t, 3> strides = {1, dims[0], std::uint64_t{dims[0]} * dims[1]};
  std::uint64_t corner = 0;  // where the canonical file begins
  for (const int axis : order) {
    const auto at = static_cast<std::size_t>(std::abs(axis) - 1);
    if (axis < 0) corner += strides.at(at) * (dims.at(at) - 1);
  }
  std::vector<Stored> piece(1);
  read_piece(samples, corner, piece);
  const Stored background = piece.front();
  const auto along = static_cast<std::size_t>(std::abs(order[0]) - 1);
  const std::uint64_t stride = strides.at(along);
  const std::uint64_t line = stride * dims.at(along);
  std::vector<Stored> before;
  std::uint64_t pairs = 0;
  std::uint64_t same = 0;
  for (std::uint64_t first = stride; first < volume.sample_count(); first += piece.size()) {
    piece.resize(static_cast<std::size_t>(
        std::min<std::uint64_t>(volume.sample_count() - first, kWidePieceSamples)));
    before.resize(piece.size());
    read_piece(samples, first, piece);
    read_piece(samples, first - stride, before);
    std::uint64_t place = first % line;
    for (std::size_t at = 0; at < piece.size(); ++at) {
      const bool is_same = piece[at] == before[at];
      const bool is_pair = place >= stride && !(is_same && piece[at] == background);
      pairs += is_pair ? 1 : 0;
      same += is_pair && is_same ? 1 : 0;
      if (++place == line) place = 0;
    }
  }
  return pairs == 0 ? 1 : static_cast<double>(same) / static_cast<double>(pairs);
}

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

[[noreturn]] void throw_too_many() {
  throw_unusable(
      "The file says that its samples are labels. They are integers of 64 bits, of which "
      "at most " +
      std::to_string(Volume::kMostLabels) +
      " can be numbered anew, but the file has more. Number the labels anew, so that "
      "they fit into 32 bits, or cut the volume into parts with fewer labels.");
}

template <class Stored>
void write_numbers(const PlainSamples& samples, const std::vector<Stored>& values,
                   const Volume& volume, std::byte* to) {
  Numbers<Stored> numbers(values);
  with_sample(volume.type, [&](auto number) {
    for_each_piece<Stored>(samples, volume.sample_count(), [&](std::span<const Stored> piece) {
      for (const Stored value : piece) {
        number = static_cast<decltype(number)>(numbers.of(value));
        std::memcpy(to, &number, sizeof(number));
        to += sizeof(number);
      }
      return true;
    });
  });
}

template <class Stored>
std::optional<Volume> write(const PlainSamples& samples, Volume volume, const ImportTask& task) {
  Survey<Stored> survey;
  for_each_piece<Stored>(samples, volume.sample_count(), [&](std::span<const Stored> piece) {
    survey.take(piece);
    return true;
  });
  const bool is_declared = samples.are_labels || !volume.labels.empty();
  if (!survey.is_wide()) return std::nullopt;
  Values<Stored> found;
  bool are_few = true;
  for_each_piece<Stored>(samples, volume.sample_count(), [&](std::span<const Stored> piece) {
    return are_few = found.take(piece);
  });
  if (!are_few || !found.sort()) {
    if (is_declared) throw_too_many();
    return std::nullopt;
  }
  const std::vector<Stored>& values = found.all();
  if (!is_declared && share_of_equal<Stored>(samples, volume) < kFlat) return std::nullopt;
  if (!std::in_range<std::int64_t>(values.back())) {
    throw_unusable("The label " + std::to_string(values.back()) +
                   " is too large: labels up to 9223372036854775807 are read. Number the labels "
                   "anew and upload them again.");
  }
  volume.type = values.size() <= std::numeric_limits<std::uint8_t>::max() ? SampleType::kUint8
                                                                          : SampleType::kUint16;
  const auto dims =
      samples.is_segmentation ? with_room(volume.dims, volume.type, task.limits) : volume.dims;
  CanonicalWriter writer(task.target, {dims, volume.type, volume.geometry});
  write_numbers(samples, values, volume, writer.samples().data());
  volume.labels = entries_of(values, volume.labels);
  volume.notes.push_back(renumbered_note(values.size()));
  return finish(writer, std::move(volume), {.is_segmentation = samples.is_segmentation});
}

}  // namespace

std::optional<Volume> write_wide_labels(const PlainSamples& samples, const Volume& volume,
                                        const ImportTask& task) {
  if (samples.layout.rescale) return std::nullopt;
  if (samples.layout.type == StoredType::kUint64)
    return write<std::uint64_t>(samples, volume, task);
  if (samples.layout.type == StoredType::kInt64) return write<std::int64_t>(samples, volume, task);
  return std::nullopt;
}

}  // namespace isomesh::import
