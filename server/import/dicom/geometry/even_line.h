// The line of evenly spaced places that lies nearest to places which are not quite even.
#pragma once

#include <span>
#include <vector>

#include "server/import/source/names.h"

namespace isomesh::import::dicom {

struct EvenLine {
  Vector3 origin = {};
  Vector3 step = {};
  Vector3 off = {};     // the largest deviation of each coordinate
  double farthest = 0;  // of a place from its place in the line, mm
  // Coordinates that deviate are whole multiples of 1, 0.1 or 0.01 mm; 0: of none of them.
  Vector3 rounding = {};

  // True if the places are those of the line, rounded.
  bool explains_places() const;
};

// Makes the largest deviation of each coordinate as small as possible. Place i is that of step
// `steps[i]`; these ascend. Needs two places or more.
EvenLine nearest_line(std::span<const Vector3> places, std::span<const double> steps);

}  // namespace isomesh::import::dicom
