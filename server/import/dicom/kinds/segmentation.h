// Segmentations (PS3.3, A.51): frames of single bits or of shares, one segment each; and label
// maps, whose samples are the segments' numbers. Frames without a label are often left out. A share
// counts from a half on; segments may overlap.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

bool is_segmentation(const DataSet& data);

// Throws Error kUnusableVolume for kinds that are not known.
Segmentation describe_segmentation(const DataSet& data);

// The number of the segment that a frame of a segmentation shows that is no label map. Throws Error
// kUnusableVolume when the object does not tell it.
std::uint32_t segment_of(const DataSet& data, std::uint32_t frame);

// "2 (\"liver\")"
std::string segment_name(const Image& image, std::uint64_t number);

// As make_stack, for the frames of one segmentation: several may lie at one position when they are
// of different segments, and positions may be without a frame. Positions and the distance that the
// object tells make the lattice: the distance is taken where all positions are a whole number of it
// apart, otherwise the smallest gap.
Stack make_label_stack(std::vector<Slice> slices);

// Whether the samples are the shares of one segment, which are kept as they are.
bool are_shares(const Stack& stack);

// The share from which on a sample is of its segment.
double half_of(const Stack& stack);

// How shares became segments; empty where there are none.
std::optional<Note> note_on_shares(const Stack& stack);

// The types that may hold the labels, the smallest first.
std::vector<SampleType> label_types(const Stack& stack);

// Reads a slice's samples into the span, which has its layout's bytes.
using ReadSlice = std::function<void(std::size_t slice, std::span<std::byte> stored)>;

// Writes the labels of all slices of the stack as `type`; samples of no segment, and planes without
// a frame, are 0. Samples of several segments have the number of their combination
// (combinations.h). False when the type does not hold all of them. Sets the volume's labels, and
// notes overlaps in it. Throws Error kUnusableVolume when there are too many combinations.
bool write_labels(const Stack& stack, SampleType type, const ReadSlice& read,
                  std::span<std::byte> target, Volume& volume);

}  // namespace isomesh::import::dicom
