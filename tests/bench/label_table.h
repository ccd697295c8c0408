// How near smoothed labels come to the solids that their samples were taken from.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tests/bench/label_shapes.h"
#include "tests/bench/rows.h"

namespace isomesh::bench {

enum class StairSmoothing {
  kLabels,     // the default of jobs by labels
  kLaplacian,  // 10 passes with a relaxation factor of 0.33, at most half the smallest spacing
};

// Means over some placements of a shape, unless told otherwise. Changes are in percent. Lengths are
// in samples: of the geometric mean of the spacing, and for faces along their own axis.
struct ShapeFigures {
  double outer_area = 0;  // of walls to the background
  double worst_outer_area = 0;
  double inner_area = 0;  // of walls between labels
  // Volume enclosed by a label, relative to its voxels: the worst change, then the extremes of the
  // quotient.
  double worst_volume = 0;
  double least_volume = 0;
  double most_volume = 0;
  double distance = 0;  // of a triangle's centre, weighted by area
  double worst_distance = 0;
  double worst_face = 0;  // of a flat face, at 3 samples and more from edges
  double curve_length = 0;
  double folded = 0;  // triangles, in percent
  double triangles = 0;
};

ShapeFigures measure_shape(const std::string& name, double radius, const ShapePoint& spacing,
                           StairSmoothing smoothing, std::size_t placements);

// Volumes of the labels of more than 1 000 voxels beside those of their voxels, in percent.
struct VolumeFigures {
  std::size_t labels = 0;
  double mean = 0;  // of the absolute values
  double worst = 0;
  std::int64_t worst_label = 0;
  std::size_t beyond_half = 0;  // labels that are more than 0.5 % off
  double folded = 0;            // triangles, in percent
};

VolumeFigures measure_volumes(const Samples& samples, StairSmoothing smoothing);

// Every `step`-th slice, with the spacing that they then have.
Samples every_slice(const Samples& samples, std::uint32_t step);

inline constexpr std::size_t kShapePlacements = 4;

// The shapes at the spacings 1:1:1, 1:1:2, 1:1:3 and 1:1:5, in both ways.
Json shape_table(std::size_t placements);

// The segmentations whole and every third slice.
Json volume_table(const std::vector<Samples>& segmentations);

}  // namespace isomesh::bench
