// Stored samples -> what they mean: bits cut out, signs extended, slope and intercept applied.
#pragma once

#include <span>
#include <vector>

#include "proto/types.h"
#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// The types to try, in order, for the samples of all slices; the last holds every one. They are
// integers where all slopes and intercepts are, otherwise float32, or float64 for integers of 32
// bits and floating-point numbers of 64. int16 is tried before int32 because what a CT stores in 16
// bits is seldom beyond it.
std::vector<SampleType> candidate_types(std::span<const Slice> slices);

// Writes the values of one frame's stored samples as `type`; samples that are padding keep their
// values. False when one of them does not fit.
bool convert_frame(std::span<const std::byte> stored, const PixelLayout& layout,
                   const Rescale& rescale, SampleType type, std::span<std::byte> target);

}  // namespace isomesh::import::dicom
