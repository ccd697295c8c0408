// Segmentations (PS3.3, A.51): frames of single bits, one segment each; and label maps, whose
// samples are the segments' numbers. Frames without a label are often left out.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "server/import/dicom/stack.h"

namespace isomesh::import::dicom {

bool is_segmentation(const DataSet& data);

// Throws Error kUnusableVolume for kinds that are no labels: fractional ones.
Segmentation describe_segmentation(const DataSet& data);

// The number of the segment that a frame of a binary segmentation shows. Throws Error
// kUnusableVolume when the object does not tell it.
std::uint32_t segment_of(const DataSet& data, std::uint32_t frame);

// "2 (\"liver\")"
std::string segment_name(const Image& image, std::uint64_t number);

// As make_stack, for the frames of one segmentation: several may lie at one position when they are
// of different segments, and positions may be without a frame. Positions and the distance that the
// object tells make the lattice: the distance is taken where all positions are a whole number of it
// apart, otherwise the smallest gap.
Stack make_label_stack(std::vector<Slice> slices);

// The type that holds the numbers of all segments.
SampleType label_type(std::span<const Slice> slices);

// Reads a slice's samples into the span, which has its layout's bytes.
using ReadSlice = std::function<void(std::size_t slice, std::span<std::byte> stored)>;

// Writes the labels of all slices of the stack as `type`; samples of no segment, and planes without
// a frame, are 0. Throws Error kUnusableVolume, naming both, where two segments overlap, with a
// choice of each segment.
void write_labels(const Stack& stack, SampleType type, const ReadSlice& read,
                  std::span<std::byte> target);

}  // namespace isomesh::import::dicom
