// RT structure sets of a few contours.
#pragma once

#include <string>
#include <vector>

#include "tests/unit/import/dicom/objects.h"

namespace isomesh::import::test {

using Points = std::vector<Vector3>;

struct TestContour {
  Points points;
  std::string type = "CLOSED_PLANAR";
};

struct TestStructure {
  unsigned number = 1;
  std::string name = {};
  std::vector<TestContour> contours = {};
  std::string color = "255\\0\\0";
};

// A structure set of the series 1.2.9, in the frame of reference 1.2.3.frame. Coordinates have six
// decimals.
DicomObject structure_set(const std::vector<TestStructure>& structures);

// A rectangle in the plane at z.
Points box(double left, double top, double right, double bottom, double z);

}  // namespace isomesh::import::test
