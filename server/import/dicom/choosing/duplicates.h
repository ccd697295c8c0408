// Slices that occur more than once at one place -> one of them.
#pragma once

#include <functional>
#include <vector>

#include "proto/notes.h"
#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

// True if two slices have the same values.
using SameSamples = std::function<bool(const Slice& one, const Slice& other)>;

struct DistinctSlices {
  std::vector<Slice> slices;
  std::vector<Slice> left_out;
};

// Keeps one of the slices at each place: the one with the lowest instance number, then the first by
// name. Adds a note. Changes nothing if each position has as many slices, unless all of them have
// the same samples: others are several volumes.
//
// Throws Error kUnusableVolume as refuse_mixtures does, and if slices at one place have different
// values: overridable unless at least half of the places have several slices, half of which differ.
DistinctSlices without_duplicates(std::vector<Slice> slices, const SameSamples& same_samples,
                                  const ImportOptions& options, std::vector<Note>& notes);

}  // namespace isomesh::import::dicom
