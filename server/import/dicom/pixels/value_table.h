// Modality lookup tables: stored values -> modality values.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// The Modality LUT Sequence of an object (PS3.3, C.11.1); empty without one. Throws Error
// kUnusableVolume if the table is incomplete, or if the samples are not integers of 8 or 16 bits.
std::optional<ValueTable> value_table(const DataSet& data, const PixelLayout& stored);

// Replaces stored samples by the table's values. `target` has two bytes for each sample,
// little-endian.
void apply_table(const ValueTable& table, const PixelLayout& layout,
                 std::span<const std::byte> stored, std::span<std::byte> target);

}  // namespace isomesh::import::dicom
