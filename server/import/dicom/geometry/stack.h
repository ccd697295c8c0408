// Frames in the order in which they come -> one lattice, or the reason why they make none.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// One frame of a series.
struct Slice {
  const Image* image = nullptr;
  const Frame* frame = nullptr;
  std::size_t file = 0;  // index of the file that holds it
};

struct Stack {
  std::vector<Slice> slices;  // from the first plane of the lattice to the last
  Geometry geometry;
  // Slices are numbered from 1 as the scanner did: from the other end where its instance numbers
  // fall along the stack.
  bool numbered_from_end = false;
  // Of a segmentation: the plane of each slice, and how many planes there are. Empty elsewhere,
  // where every plane has its slice.
  std::vector<std::uint32_t> planes = {};
  std::uint32_t plane_count = 0;

  std::uint32_t depth() const {
    return plane_count > 0 ? plane_count : static_cast<std::uint32_t>(slices.size());
  }

  // "slice 3 of 20", for a slice by its place in `slices`.
  std::string name(std::size_t place) const;
};

// Sorts slices by position along their normal, never by name or instance number. A tilted gantry
// makes a sheared lattice: the third direction is the one from slice to slice. Frames of reference
// are not looked at (frame_of_reference.h).
//
// Throws Error kUnusableVolume, naming slices, when there are fewer than two, their sizes,
// spacings or orientations (a component by more than 5e-4) differ, several lie at one position, one
// is missing, or one lies further from its place in the lattice than a twentieth of the slices'
// distance.
Stack make_stack(std::vector<Slice> slices);

}  // namespace isomesh::import::dicom
