// Padding (PS3.3, C.7.5.1.1.2): stored values that are not part of the image, such as those around
// a round field of view.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "server/import/dicom/geometry/image.h"
#include "server/import/source/sample_set.h"

namespace isomesh::import::dicom {

// The padding of an object with samples of this layout. Empty if its header defines none: values
// that are only usual for padding may be samples. The value has the sign of the samples, whatever
// its value representation: programs confuse US and SS.
std::optional<PaddingRange> padding_range(const DataSet& data, const PixelLayout& stored);

// Adds the padding among a frame's stored values to `found`. The frame begins at sample `first`.
void find_padding(const PaddingRange& padding, const PixelLayout& layout,
                  std::span<const std::byte> stored, std::uint64_t first, SampleSet& found);

}  // namespace isomesh::import::dicom
