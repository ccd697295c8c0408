// Segmentations (PS3.3, A.51): frames of bits or fractions, one segment each, and label maps, whose
// samples are segment numbers. Frames without a label are often missing. Fractions from one half on
// belong to the segment. Segments may overlap.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

bool is_segmentation(const DataSet& data);

// Throws Error kUnusableVolume for unknown kinds.
Segmentation describe_segmentation(const DataSet& data);

// The segment of a frame; not for label maps. Throws Error kUnusableVolume if it is missing.
std::uint32_t segment_of(const DataSet& data, std::uint32_t frame);

// "2 (\"liver\")"
std::string segment_name(const Image& image, std::uint64_t number);

// As make_stack, for the frames of one segmentation: frames of different segments may share a
// position, and positions may be missing. The lattice follows from the positions and the object's
// slice distance. That distance is used if it divides the distances of all positions, otherwise the
// smallest gap. A single plane is as thick as the planes of the whole object are apart, or, if it
// has no others, as the object's slice distance or slice thickness, or that of the option
// `spacing`, which other segmentations reject.
Stack make_label_stack(std::vector<Slice> slices, const ImportOptions& options);

// True if the samples are the fractions of one segment, which are stored unchanged.
bool are_shares(const Stack& stack);

// The sample value of one half.
double half_of(const Stack& stack);

// A note on the threshold of fractions; empty without fractions.
std::optional<Note> note_on_shares(const Stack& stack);

// The types that may hold the labels, smallest first.
std::vector<SampleType> label_types(const Stack& stack);

// Reads a slice's stored samples; the span has its layout's size.
using ReadSlice = std::function<void(std::size_t slice, std::span<std::byte> stored)>;

// Writes the labels of all slices as `type`. Samples outside of all segments, and planes without a
// frame, are 0. Samples of several segments get the number of their combination (combinations.h).
// Returns false if the type is too small. Sets the volume's labels, and adds a note on overlaps.
// Throws Error kUnusableVolume if there are too many combinations.
bool write_labels(const Stack& stack, SampleType type, const ReadSlice& read,
                  std::span<std::byte> target, Volume& volume);

}  // namespace isomesh::import::dicom
