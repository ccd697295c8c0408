// Palettes (PS3.3, C.7.6.3.1.5 and C.7.9.2), which give the labels of a label map their colours.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

struct Palette {
  std::int64_t first = 0;                             // the stored value of the first entry
  double most = 0xFF;                                 // full intensity
  std::array<std::vector<std::uint16_t>, 3> entries;  // red, green, blue; as many of each

  // "#rrggbb" of a stored value. Values beyond an end have the color of that end.
  std::optional<std::string> color(std::int64_t value) const;
};

// The palette of an object in PALETTE COLOR, with plain or segmented tables. Empty for other
// objects. A damaged palette is empty, too, because the samples do not depend on it.
std::optional<Palette> read_palette(const DataSet& data);

}  // namespace isomesh::import::dicom
