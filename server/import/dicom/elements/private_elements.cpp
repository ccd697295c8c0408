#include "server/import/dicom/elements/private_elements.h"

#include <algorithm>
#include <array>

namespace isomesh::import::dicom {
namespace {

struct NeededElement {
  std::string_view creator;
  Tag tag;
};

constexpr std::string_view kSiemens = "SIEMENS MR HEADER";
constexpr std::string_view kUnitedImaging = "Image Private Header";

constexpr std::array kNeededElements = {NeededElement{"SIEMENS CSA HEADER", kCsaImageHeader},
                                        NeededElement{"SIEMENS CSA HEADER", kCsaSeriesHeader},
                                        NeededElement{kSiemens, kMosaicImages},
                                        NeededElement{kSiemens, kSiemensBValue},
                                        NeededElement{kUnitedImaging, kGridImages},
                                        NeededElement{kUnitedImaging, kGridFrames},
                                        NeededElement{kUnitedImaging, kGridBValue}};

constexpr Tag kBlock10 = 0x1000;

}  // namespace

void PrivateBlocks::reserve(Tag tag, std::string_view creator) {
  const unsigned block = tag & 0xFFFFU;
  if (!is_private(tag) || block < 0x10 || block > 0xFF) return;
  const auto* known = std::ranges::find(kNeededElements, creator, &NeededElement::creator);
  // One block per creator suffices; the limit bounds memory.
  if (known == kNeededElements.end() || blocks_.size() >= kNeededElements.size()) return;
  blocks_.push_back({(tag & 0xFFFF0000U) | block << 8, known->creator});
}

std::optional<Tag> PrivateBlocks::needed(Tag tag) const {
  const auto block = std::ranges::find(blocks_, tag & 0xFFFFFF00U, &Block::first);
  if (block == blocks_.end()) return std::nullopt;
  const Tag as_block_10 = (tag & 0xFFFF00FFU) | kBlock10;
  for (const NeededElement& each : kNeededElements) {
    if (each.creator == block->creator && each.tag == as_block_10) return each.tag;
  }
  return std::nullopt;
}

std::optional<Tag> PrivateBlocks::needed_by_value(Tag tag, std::string_view beginning) const {
  if (tag != kCsaImageHeader && tag != kCsaSeriesHeader) return std::nullopt;
  const auto block = std::ranges::find(blocks_, tag & 0xFFFFFF00U, &Block::first);
  if (block != blocks_.end() || !beginning.starts_with("SV10")) return std::nullopt;
  return tag;
}

}  // namespace isomesh::import::dicom
