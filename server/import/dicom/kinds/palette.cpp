#include "server/import/dicom/kinds/palette.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "server/import/dicom/elements/tags.h"
#include "server/import/labels/label_table.h"

namespace isomesh::import::dicom {
namespace {

using Numbers = std::vector<std::uint16_t>;

constexpr std::size_t kMostEntries = std::size_t{1} << 16;

Numbers words_of(const DataSet& data, Tag tag) {
  const std::vector<std::uint32_t> numbers = data.unsigned_numbers(tag);
  return {numbers.begin(), numbers.end()};
}

// Two to a word, the low byte first.
Numbers bytes_of(const Numbers& words) {
  Numbers bytes;
  for (const std::uint16_t word : words) {
    bytes.push_back(word & 0xFF);
    bytes.push_back(word >> 8);
  }
  return bytes;
}

// The segments of a table, one after another. Their numbers are as large as the entries.
class SegmentedTable {
 public:
  explicit SegmentedTable(Numbers numbers, unsigned bits)
      : numbers_(std::move(numbers)), bits_(bits) {}

  // Returns fewer entries than the table should have if it is damaged.
  Numbers expanded() {
    std::size_t at = 0;
    while (at < numbers_.size() && entries_.size() <= kMostEntries && expand(at, false)) {
    }
    return std::move(entries_);
  }

 private:
  // Expands the segment at that place, and moves to the next one.
  bool expand(std::size_t& at, bool is_repeated) {
    enum : std::uint16_t { kDiscrete, kLinear, kIndirect };
    if (numbers_.size() - at < 3) return false;
    const std::uint16_t kind = numbers_[at];
    const std::uint16_t count = numbers_[at + 1];
    at += 2;
    if (kind == kDiscrete) return copy(at, count);
    if (kind == kLinear) return interpolate(at, count);
    return kind == kIndirect && !is_repeated && repeat(at, count);
  }

  bool copy(std::size_t& at, std::size_t count) {
    if (numbers_.size() - at < count) return false;
    const auto begin = numbers_.begin() + static_cast<std::ptrdiff_t>(at);
    entries_.insert(entries_.end(), begin, begin + static_cast<std::ptrdiff_t>(count));
    at += count;
    return true;
  }

  bool interpolate(std::size_t& at, std::size_t count) {
    if (entries_.empty()) return false;
    const double from = entries_.back();
    const double to = numbers_[at++];
    for (std::size_t step = 1; step <= count; ++step) {
      const double share = static_cast<double>(step) / static_cast<double>(count);
      entries_.push_back(static_cast<std::uint16_t>(std::lround(from + (to - from) * share)));
    }
    return true;
  }

  // Expands earlier segments again. Their offset is in bytes, the low part first.
  bool repeat(std::size_t& at, std::size_t segments) {
    const std::size_t parts = bits_ == 8 ? 4 : 2;
    if (numbers_.size() - at < parts) return false;
    std::size_t offset = 0;
    for (std::size_t part = 0; part < parts; ++part) {
      offset |= std::size_t{numbers_[at++]} << (part * bits_);
    }
    std::size_t place = offset / (bits_ / 8);
    for (std::size_t done = 0; done < segments; ++done) {
      if (place >= numbers_.size() || entries_.size() > kMostEntries) return false;
      if (!expand(place, true)) return false;
    }
    return true;
  }

  Numbers numbers_;
  unsigned bits_;
  Numbers entries_;
};

// The entries of one color; fewer than `count` if they are damaged.
Numbers entries_of(const DataSet& data, unsigned color, std::size_t count, unsigned bits) {
  const Numbers plain = words_of(data, kRedPaletteData + color);
  if (!plain.empty()) return bits == 8 && plain.size() < count ? bytes_of(plain) : plain;
  const Numbers segments = words_of(data, kSegmentedRedPaletteData + color);
  return SegmentedTable(bits == 8 ? bytes_of(segments) : segments, bits).expanded();
}

}  // namespace

std::optional<std::string> Palette::color(std::int64_t value) const {
  const auto last = static_cast<std::int64_t>(entries[0].size()) - 1;
  const auto at = static_cast<std::size_t>(std::clamp<std::int64_t>(value - first, 0, last));
  return label_color({entries[0][at] / most, entries[1][at] / most, entries[2][at] / most});
}

std::optional<Palette> read_palette(const DataSet& data) {
  if (data.text(kPhotometricInterpretation) != "PALETTE COLOR") return std::nullopt;
  Palette palette;
  for (unsigned color = 0; color < 3; ++color) {
    const Numbers descriptor = words_of(data, kRedPaletteDescriptor + color);
    if (descriptor.size() != 3) return std::nullopt;
    const std::size_t count = descriptor[0] == 0 ? kMostEntries : descriptor[0];
    const unsigned bits = descriptor[2];
    if (bits != 8 && bits != 16) return std::nullopt;
    Numbers entries = entries_of(data, color, count, bits);
    if (entries.size() < count) return std::nullopt;
    entries.resize(count);
    palette.first = descriptor[1];
    palette.most = bits == 8 ? 0xFF : 0xFFFF;
    palette.entries[color] = std::move(entries);
  }
  const auto same = [&](const Numbers& each) { return each.size() == palette.entries[0].size(); };
  if (!std::ranges::all_of(palette.entries, same)) return std::nullopt;
  return palette;
}

}  // namespace isomesh::import::dicom
