#include "tests/bench/label_table.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "tests/bench/label_shapes.h"
#include "tests/bench/label_stages.h"
#include "tests/support/points.h"

namespace isomesh::bench {
namespace {

using test::cross;
using test::length;
using test::minus;

constexpr std::size_t kPlacements = 4;

enum class StairSmoothing { kLabels, kLaplacian };

// Means over some placements of a shape, unless told otherwise.
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
  double worst_face = 0;
  double curve_length = 0;
  double folded = 0;  // triangles, in percent
  double triangles = 0;
};

ShapePoint point_of(const mesh::Vec3& v) { return {v[0], v[1], v[2]}; }

double percent(double quotient) { return 100 * (quotient - 1); }

void run(LabelStages& stages, const Samples& samples, StairSmoothing smoothing) {
  stages.extract();
  if (smoothing == StairSmoothing::kLabels) return stages.remove_stairs();
  stages.smooth(laplacian_by_labels(samples));
}

// The surface of one placement beside its shape.
class Placement {
 public:
  Placement(const LabelShape& shape, const Samples& samples, LabelStages& stages)
      : shape_(shape), stages_(stages), mesh_(stages.surface().mesh) {
    const std::array<double, 3>& spacing = samples.geometry.spacing;
    sample_ = std::cbrt(spacing[0] * spacing[1] * spacing[2]);
  }

  ShapeFigures figures() {
    look_at_triangles();
    add_areas();
    add_volumes();
    if (shape_.curve_length > 0)
      figures_.curve_length = percent(length_of_curves() / shape_.curve_length);
    const auto triangles = static_cast<double>(mesh_.triangles.size());
    figures_.folded = 100 * static_cast<double>(stages_.count_folded()) / triangles;
    figures_.triangles = triangles;
    return figures_;
  }

 private:
  void look_at_triangles() {
    double sum = 0;
    double all = 0;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh_.triangles[t];
      const std::array corners = {point_of(mesh_.positions[a]), point_of(mesh_.positions[b]),
                                  point_of(mesh_.positions[c])};
      const double area =
          length(cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))) / 2;
      ShapePoint centre;
      for (std::size_t i = 0; i < 3; ++i) {
        centre[i] = (corners[0][i] + corners[1][i] + corners[2][i]) / 3;
      }
      const ShapeSides sides = sides_of(t);
      areas_[sides] += area;
      if (shape_.distance) {
        const double distance = shape_.distance(centre, sides) / sample_;
        sum += area * distance;
        figures_.worst_distance = std::max(figures_.worst_distance, distance);
      }
      if (shape_.from_face) {
        figures_.worst_face = std::max(figures_.worst_face, shape_.from_face(centre).value_or(0));
      }
      all += area;
    }
    figures_.distance = sum / all;
  }

  // By value: labels are numbered in ascending order.
  ShapeSides sides_of(std::size_t triangle) const {
    const auto value = [&](std::uint16_t number) {
      return number == 0 ? 0 : static_cast<int>(stages_.labels()[number - 1U]);
    };
    const mesh::WallSides sides = stages_.surface().sides[triangle];
    return std::minmax(value(sides.front), value(sides.back));
  }

  void add_areas() {
    double inner = 0;
    double outer = 0;
    std::array<double, 2> counts = {0, 0};
    for (const auto& [sides, area] : shape_.areas) {
      const double change = percent(areas_[sides] / area);
      (sides.first == 0 ? outer : inner) += change;
      ++counts[sides.first == 0 ? 0 : 1];
    }
    if (counts[0] > 0) figures_.outer_area = outer / counts[0];
    if (counts[1] > 0) figures_.inner_area = inner / counts[1];
    figures_.worst_outer_area = std::abs(figures_.outer_area);
  }

  void add_volumes() {
    const auto measured = stages_.measure();
    figures_.least_volume = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < measured.size(); ++n) {
      const double quotient = measured[n].extent.volume_mm3 / stages_.voxels()[n].volume_mm3;
      figures_.worst_volume = std::max(figures_.worst_volume, std::abs(percent(quotient)));
      figures_.least_volume = std::min(figures_.least_volume, quotient);
      figures_.most_volume = std::max(figures_.most_volume, quotient);
    }
  }

  // The number of edges with other than two triangles.
  double length_of_curves() const {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> triangles;
    for (const mesh::Triangle& triangle : mesh_.triangles) {
      for (std::size_t i = 0; i < 3; ++i) {
        ++triangles[std::minmax(triangle[i], triangle[(i + 1) % 3])];
      }
    }
    double sum = 0;
    for (const auto& [edge, count] : triangles) {
      if (count == 2) continue;
      sum += length(
          minus(point_of(mesh_.positions[edge.first]), point_of(mesh_.positions[edge.second])));
    }
    return sum;
  }

  const LabelShape& shape_;
  LabelStages& stages_;
  const mesh::Mesh& mesh_;
  double sample_ = 0;
  std::map<ShapeSides, double> areas_;
  ShapeFigures figures_;
};

std::string text_of(const ShapePoint& spacing) {
  std::string text;
  for (const double each : spacing) text += (text.empty() ? "" : ":") + fixed(each, 0);
  return text;
}

const char* name_of(StairSmoothing smoothing) {
  return smoothing == StairSmoothing::kLabels ? "labels" : "laplacian";
}

Json row_of(const std::string& shape, const ShapePoint& spacing, StairSmoothing smoothing,
            const ShapeFigures& figures) {
  return {{"shape", shape},
          {"spacing", text_of(spacing)},
          {"smoothing", name_of(smoothing)},
          {"area_%", figures.outer_area},
          {"worst_area_%", figures.worst_outer_area},
          {"inner_area_%", figures.inner_area},
          {"worst_volume_%", figures.worst_volume},
          {"least_volume", figures.least_volume},
          {"most_volume", figures.most_volume},
          {"distance", figures.distance},
          {"worst_distance", figures.worst_distance},
          {"worst_face", figures.worst_face},
          {"curve_%", figures.curve_length},
          {"folded_%", figures.folded},
          {"triangles", static_cast<std::uint64_t>(figures.triangles)}};
}

ShapeFigures measure_shape(const std::string& name, double radius, const ShapePoint& spacing,
                           StairSmoothing smoothing) {
  ShapeFigures all = {.least_volume = std::numeric_limits<double>::infinity()};
  const double share = 1 / static_cast<double>(kPlacements);
  for (std::size_t place = 0; place < kPlacements; ++place) {
    const LabelShape shape = label_shape(name, radius, spacing, place);
    const Samples samples = sample_shape(shape, spacing);
    LabelStages stages(samples);
    run(stages, samples, smoothing);
    const ShapeFigures one = Placement(shape, samples, stages).figures();
    for (double ShapeFigures::*const mean :
         {&ShapeFigures::outer_area, &ShapeFigures::inner_area, &ShapeFigures::distance,
          &ShapeFigures::curve_length, &ShapeFigures::folded, &ShapeFigures::triangles}) {
      all.*mean += share * one.*mean;
    }
    for (double ShapeFigures::*const worst :
         {&ShapeFigures::worst_outer_area, &ShapeFigures::worst_volume, &ShapeFigures::most_volume,
          &ShapeFigures::worst_distance, &ShapeFigures::worst_face}) {
      all.*worst = std::max(all.*worst, one.*worst);
    }
    all.least_volume = std::min(all.least_volume, one.least_volume);
  }
  return all;
}

Json volume_row(const Samples& samples, StairSmoothing smoothing) {
  constexpr std::uint64_t kLeastVoxels = 1001;
  constexpr double kMuch = 0.5;  // percent
  LabelStages stages(samples);
  run(stages, samples, smoothing);
  const auto measured = stages.measure();
  std::uint64_t labels = 0;
  std::uint64_t far_off = 0;
  double sum = 0;
  double worst = 0;
  std::int64_t worst_label = 0;
  for (std::size_t n = 0; n < measured.size(); ++n) {
    const mesh::LabelVoxels& label = stages.voxels()[n];
    if (label.voxels < kLeastVoxels) continue;
    const double change = percent(measured[n].extent.volume_mm3 / label.volume_mm3);
    ++labels;
    sum += std::abs(change);
    if (std::abs(change) > kMuch) ++far_off;
    if (std::abs(change) <= std::abs(worst)) continue;
    worst = change;
    worst_label = label.label;
  }
  return {{"segmentation", samples.name},
          {"smoothing", name_of(smoothing)},
          {"labels", labels},
          {"mean_%", labels == 0 ? 0 : sum / static_cast<double>(labels)},
          {"worst_%", worst},
          {"worst_label", worst_label},
          {"beyond_0.5_%", far_off},
          {"folded_%", 100 * static_cast<double>(stages.count_folded()) /
                           static_cast<double>(stages.size().triangles)}};
}

// Every `step`-th slice, with the spacing that they then have.
Samples every_slice(const Samples& samples, std::uint32_t step) {
  Samples result = samples;
  result.dims.z = (samples.dims.z + step - 1) / step;
  result.geometry.spacing[2] *= step;
  const std::size_t slice = samples.bytes.size() / samples.dims.z;
  for (std::size_t z = 0; z < result.dims.z; ++z) {
    std::memcpy(result.bytes.data() + z * slice, samples.bytes.data() + z * step * slice, slice);
  }
  result.bytes.resize(result.dims.z * slice);
  if (step == 1) return result;
  result.source.clear();
  result.name += ", every " + std::to_string(step) + ". slice";
  return padded(result);  // what was dropped may have been the background above
}

}  // namespace

Json shape_table() {
  const std::vector<std::pair<std::string, double>> shapes = {{"ball", 3},
                                                              {"ball", 5},
                                                              {"ball", 10},
                                                              {"ball", 20},
                                                              {"ball", 40},
                                                              {"tube", 10},
                                                              {"box", 12},
                                                              {"tilted box", 12},
                                                              {"voxel", 1},
                                                              {"sheet across x", 10},
                                                              {"sheet across z", 10},
                                                              {"tilted sheet", 10},
                                                              {"thread along x", 10},
                                                              {"thread along z", 10},
                                                              {"tilted thread", 10},
                                                              {"halves", 10},
                                                              {"sectors", 10}};
  Json rows = Json::array();
  for (const double z : {1, 2, 3, 5}) {
    const ShapePoint spacing = {1, 1, z};
    for (const auto& [name, radius] : shapes) {
      for (const StairSmoothing smoothing : {StairSmoothing::kLabels, StairSmoothing::kLaplacian}) {
        rows.push_back(row_of(name + ' ' + fixed(radius, 0), spacing, smoothing,
                              measure_shape(name, radius, spacing, smoothing)));
      }
    }
  }
  return rows;
}

Json volume_table(const std::vector<Samples>& segmentations) {
  Json rows = Json::array();
  for (const Samples& whole : segmentations) {
    for (const std::uint32_t step : {1U, 3U}) {
      const Samples samples = every_slice(whole, step);
      for (const StairSmoothing smoothing : {StairSmoothing::kLabels, StairSmoothing::kLaplacian}) {
        rows.push_back(volume_row(samples, smoothing));
      }
    }
  }
  return rows;
}

}  // namespace isomesh::bench
