// The private elements of manufacturers that a volume needs.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// Siemens: how many slices a mosaic holds, and a header of their own (csa_header.h). United
// Imaging: how many slices a grid holds, and an item for each. Tags are those of the block 10.
inline constexpr Tag kMosaicImages = 0x0019100A;
inline constexpr Tag kCsaImageHeader = 0x00291010;
inline constexpr Tag kGridImages = 0x00651050;
inline constexpr Tag kGridFrames = 0x00651051;
inline constexpr Tag kSiemensBValue = 0x0019100C;
inline constexpr Tag kGridBValue = 0x00651009;

inline constexpr bool is_private(Tag tag) { return (tag >> 16 & 1U) != 0; }

// How long a private value may be to be read: no CSA header comes near it.
inline constexpr std::uint64_t kLongestPrivateValue = std::uint64_t{1} << 20;

// Which creator has reserved which block of private elements in a data set (PS3.5, 7.8.1).
class PrivateBlocks {
 public:
  // Learns of an element (gggg,00bb), whose value names the creator of (gggg,bb00) to (gggg,bbFF).
  void reserve(Tag tag, std::string_view creator);

  // The element's tag as if its creator had reserved the block 10, for those that a volume needs.
  std::optional<Tag> needed(Tag tag) const;

 private:
  struct Block {
    Tag first = 0;  // (gggg,bb00)
    std::string_view creator;
  };

  std::vector<Block> blocks_;
};

}  // namespace isomesh::import::dicom
