// The private elements that volumes need.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// Siemens: the number of slices of a mosaic, and the CSA headers of the image (csa_header.h) and of
// the series (csa_header.h). United Imaging: the number of slices of a grid, and an item for each.
// Tags are those in block 10.
inline constexpr Tag kMosaicImages = 0x0019100A;
inline constexpr Tag kCsaImageHeader = 0x00291010;
inline constexpr Tag kCsaSeriesHeader = 0x00291020;
inline constexpr Tag kGridImages = 0x00651050;
inline constexpr Tag kGridFrames = 0x00651051;
inline constexpr Tag kSiemensBValue = 0x0019100C;
inline constexpr Tag kGridBValue = 0x00651009;

inline constexpr bool is_private(Tag tag) { return (tag >> 16 & 1U) != 0; }

// Longer private values are skipped; no CSA header is nearly as long.
inline constexpr std::uint64_t kLongestPrivateValue = std::uint64_t{1} << 20;

// The creators of the blocks of private elements in a data set (PS3.5, 7.8.1).
class PrivateBlocks {
 public:
  // Records an element (gggg,00bb). Its value names the creator of (gggg,bb00) to (gggg,bbFF).
  void reserve(Tag tag, std::string_view creator);

  // The element's tag in block 10; empty if volumes do not need it.
  std::optional<Tag> needed(Tag tag) const;

  // The same for an element whose block has no creator, because some anonymisers remove it. Only
  // CSA headers are known, by the first bytes of their value.
  std::optional<Tag> needed_by_value(Tag tag, std::string_view beginning) const;

 private:
  struct Block {
    Tag first = 0;  // (gggg,bb00)
    std::string_view creator;
  };

  std::vector<Block> blocks_;
};

}  // namespace isomesh::import::dicom
