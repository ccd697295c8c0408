// The palettes of a stack's indexed pages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/import/images/page.h"

namespace isomesh::import {

// Collects what the pages of a stack say, one after the other. A stack whose palettes have only
// greys is a grey picture: its samples are the greys, whatever their indices are. In any other
// stack the indices are the samples, and the colours are those of labels. Not thread safe.
class Palettes {
 public:
  // Begins the next page. Throws Error kUnusableVolume for too many different palettes.
  void begin(const PageLayout& layout);
  // Samples of this page.
  void use(std::span<const std::byte> samples);

  // True if the samples of pages must be replaced by the greys of their palettes.
  bool replaces() const;
  void replace(std::uint64_t page, std::span<std::byte> samples) const;

  // The colours of the indices that samples have, except 0, which is the background. Empty for grey
  // pictures. Throws Error kUnusableVolume if an index has several colours, or if only some pages
  // are indexed: their indices would not be the same labels.
  std::vector<LabelEntry> labels() const;

  // On samples whose index is beyond their palette; empty if there are none. They are black in grey
  // pictures, and otherwise labels without a colour.
  std::optional<Note> note() const;

 private:
  // Consecutive pages with one palette, which is empty for grey pages.
  struct Run {
    std::uint64_t first_page = 0;
    std::vector<Colour> palette;
    std::vector<bool> used = {};
    StoredType type = StoredType::kUint8;

    // Empty beyond the palette.
    std::optional<Colour> colour(std::size_t index) const {
      return index < palette.size() ? std::optional(palette[index]) : std::nullopt;
    }
    std::uint8_t grey(std::size_t index) const { return colour(index).value_or(Colour{})[0]; }
  };

  bool are_grey() const;

  std::vector<Run> runs_;
  std::uint64_t pages_ = 0;
  std::uint64_t indices_ = 0;  // of all palettes, used or not
  std::uint64_t beyond_ = 0;   // samples
};

}  // namespace isomesh::import
