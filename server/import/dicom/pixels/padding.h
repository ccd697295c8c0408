// Padding (PS3.3, C.7.5.1.1.2): stored values that are not part of the image, such as those around
// a round field of view.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// The padding of an object with samples of this layout. Empty if its header defines none: values
// that are only usual for padding may be samples. The value has the sign of the samples, whatever
// its value representation: programs confuse US and SS.
std::optional<PaddingRange> padding_range(const DataSet& data, const PixelLayout& stored);

// Sets the padding among a frame's stored values in `found`, which has an element for each of the
// volume's `total` samples, or none before the first padding. The frame begins at sample `first`.
void find_padding(const PaddingRange& padding, const PixelLayout& layout,
                  std::span<const std::byte> stored, std::uint64_t first, std::uint64_t total,
                  std::vector<bool>& found);

}  // namespace isomesh::import::dicom
