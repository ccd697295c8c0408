// Unordered frames -> one lattice, or the reason why they have none.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "proto/notes.h"
#include "server/import/dicom/geometry/image.h"
#include "server/import/source/names.h"

namespace isomesh::import::dicom {

struct Slice {
  const Image* image = nullptr;
  const Frame* frame = nullptr;
  std::size_t file = 0;  // index of its file
};

struct Stack {
  std::vector<Slice> slices;  // from the first plane of the lattice to the last
  Geometry geometry;
  // Slices are numbered from 1 as by the scanner: from the other end if its instance numbers
  // descend along the stack.
  bool numbered_from_end = false;
  // For a segmentation: each slice's plane, and the number of planes. Otherwise empty: every plane
  // has a slice.
  std::vector<std::uint32_t> planes = {};
  std::uint32_t plane_count = 0;
  bool is_distance_assumed = false;  // the distance between slices is their thickness
  std::vector<Slice> left_out = {};  // other slices at positions that `slices` have

  std::uint32_t depth() const {
    return plane_count > 0 ? plane_count : static_cast<std::uint32_t>(slices.size());
  }

  // "slice 3 of 20", for an index in `slices`.
  std::string name(std::size_t place) const;
};

// Sorts slices by position along their normal, never by name or instance number. A tilted gantry
// gives a sheared lattice: the third axis runs from slice to slice. Does not check frames of
// reference (choosing/choice.cpp).
//
// Positions that are not even, but are even ones that were rounded to 1, 0.1 or 0.01 mm, give the
// even ones, with a note; so do those that `options` accept because they lie less than half a slice
// distance from even ones.
//
// Throws Error kUnusableVolume, naming slices, if there are fewer than two; if their sizes,
// spacings or orientations (a component by more than 5e-4) differ; if several are at one position;
// if one is missing; or if one deviates from its lattice position by more than a twentieth of the
// slice distance for any other reason.
Stack make_stack(std::vector<Slice> slices, const ImportOptions& options, std::vector<Note>& notes);

}  // namespace isomesh::import::dicom
