// Solids as segmentations, of which everything is known.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/samples.h"

namespace isomesh::bench {

using ShapePoint = std::array<double, 3>;
using ShapeSides = std::pair<int, int>;  // labels, the smaller first; 0 is the background

// Around the origin, or near it.
struct LabelShape {
  std::function<int(const ShapePoint&)> label;
  double reach = 0;  // along each axis, from the origin
  // From the surface between those labels. Empty if the shape is thinner than a sample.
  std::function<double(const ShapePoint&, const ShapeSides&)> distance = {};
  // From a flat face that the point is near to, in samples; none near an edge of the solid.
  std::function<std::optional<double>(const ShapePoint&)> from_face = {};
  std::map<ShapeSides, double> areas = {};
  double curve_length = 0;  // where three labels or more meet
};

// A shape by name, "ball" or another of its table, of that size in the unit of the
// spacing. `place`, from 0 on, moves it off the samples by a part of the spacing. Throws
// std::out_of_range for another name.
LabelShape label_shape(const std::string& name, double radius, const ShapePoint& spacing,
                       std::size_t place);

// As uint8 with enough background around it that all its labels are closed.
Samples sample_shape(const LabelShape& shape, const ShapePoint& spacing);

}  // namespace isomesh::bench
