// Stored samples -> modality values: extracts bits, extends signs, applies slope and intercept, or
// a modality lookup table.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// The types to try, in order, for the samples of all slices; the last fits all. They are integers
// if all slopes and intercepts are, otherwise float32, or float64 for 32-bit integers, 64-bit
// floats, and integers that would become equal in float32 because the intercept is far larger than
// the slope. int16 precedes int32, because 16-bit CT values seldom exceed it.
std::vector<SampleType> candidate_types(std::span<const Slice> slices);

// Writes the values of one frame's stored samples as `type`; padding is not treated specially.
// Returns false if one does not fit.
bool convert_frame(std::span<const std::byte> stored, const PixelLayout& layout,
                   const Rescale& rescale, SampleType type, std::span<std::byte> target);

// The Modality LUT Sequence of an object (PS3.3, C.11.1); empty without one. Throws Error
// kUnusableVolume if the table is incomplete, or if the samples are not integers of 8 or 16 bits.
std::optional<ValueTable> value_table(const DataSet& data, const PixelLayout& stored);

// Replaces stored samples by the table's values. `target` has two bytes for each sample,
// little-endian.
void apply_table(const ValueTable& table, const PixelLayout& layout,
                 std::span<const std::byte> stored, std::span<std::byte> target);

}  // namespace isomesh::import::dicom
