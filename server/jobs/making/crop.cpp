#include "server/jobs/making/crop.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <type_traits>

#include "proto/samples.h"
#include "server/mesh/lattice/lattice.h"
#include "server/volume/labels.h"

namespace isomesh::jobs {
namespace {

// A sample on a face of the box is in it, however its coordinates are rounded.
constexpr double kTolerance = 1e-6;  // of a spacing

// "from (0, 0, 0) to (10, 20, 30) mm": the smallest box along the axes of space that holds all
// samples.
std::string extent_of(const mesh::LatticeToSpace& to_space,
                      const std::array<std::uint32_t, 3>& dims) {
  std::array<std::string, 2> ends = {"(", "("};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::array<double, 2> bounds = {to_space.origin[axis], to_space.origin[axis]};
    const std::array<double, 3> steps = {to_space.step_x[axis], to_space.step_y[axis],
                                         to_space.step_z[axis]};
    for (std::size_t step = 0; step < 3; ++step) {
      const double way = steps.at(step) * (dims.at(step) - 1.0);
      bounds[way < 0 ? 0 : 1] += way;
    }
    for (std::size_t end = 0; end < 2; ++end) {
      std::array<char, 32> text = {};
      std::snprintf(text.data(), text.size(), "%.6g", bounds.at(end));
      ends.at(end) += std::string(axis == 0 ? "" : ", ") + text.data();
    }
  }
  return "from " + ends[0] + ") to " + ends[1] + ") mm";
}

}  // namespace

SampleRange samples_in(const Box& box, const Geometry& geometry,
                       const std::array<std::uint32_t, 3>& dims) {
  std::array<double, 3> low;
  std::array<double, 3> high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  const mesh::LatticeToSpace to_space = mesh::lattice_to_space(geometry);
  for (unsigned corner = 0; corner < 8; ++corner) {
    const auto index = mesh::index_of(
        to_space, {box[corner & 1][0], box[corner >> 1 & 1][1], box[corner >> 2 & 1][2]});
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], index[axis]);
      high[axis] = std::max(high[axis], index[axis]);
    }
  }
  SampleRange range;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double count = dims[axis];
    const double begin = std::clamp(std::ceil(low[axis] - kTolerance), 0.0, count);
    const double end = std::clamp(std::floor(high[axis] + kTolerance) + 1, 0.0, count);
    if (end - begin < 2) {
      throw invalid_parameter("crop",
                              "the box contains fewer than two samples along the volume's axis " +
                                  std::string(1, "xyz"[axis]) +
                                  ", so there is no surface; the volume's samples are " +
                                  extent_of(to_space, dims));
    }
    range.begin[axis] = static_cast<std::uint32_t>(begin);
    range.end[axis] = static_cast<std::uint32_t>(end);
  }
  return range;
}

CroppedSamples::CroppedSamples(const SampleArray& samples, const MeshParameters& parameters)
    : array_(samples) {
  if (parameters.crop) crop(samples, samples_in(*parameters.crop, samples.geometry, samples.dims));
  if (parameters.labels && !is_integer(samples.type)) round();
}

std::uint64_t CroppedSamples::most_bytes(const MeshParameters& parameters, const Geometry& geometry,
                                         const std::array<std::uint32_t, 3>& dims,
                                         SampleType type) {
  SampleRange range = {.begin = {0, 0, 0}, .end = dims};
  if (parameters.crop) range = samples_in(*parameters.crop, geometry, dims);
  const bool is_rounded = parameters.labels && !is_integer(type);
  return range.count() *
         ((parameters.crop ? bytes_per_sample(type) : 0) + (is_rounded ? sizeof(std::int32_t) : 0));
}

void CroppedSamples::crop(const SampleArray& samples, const SampleRange& range) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    array_.dims[axis] = range.end[axis] - range.begin[axis];
    const double way = samples.geometry.spacing[axis] * range.begin[axis];
    for (std::size_t row = 0; row < 3; ++row) {
      array_.geometry.origin[row] += samples.geometry.direction[3 * row + axis] * way;
    }
  }
  const std::size_t sample = bytes_per_sample(samples.type);
  const std::size_t row_bytes = sample * array_.dims[0];
  copy_.resize_for_overwrite(range.count() * sample);
  std::byte* to = copy_.data();
  for (std::uint64_t z = range.begin[2]; z < range.end[2]; ++z) {
    for (std::uint64_t y = range.begin[1]; y < range.end[1]; ++y) {
      const std::uint64_t first = (z * samples.dims[1] + y) * samples.dims[0] + range.begin[0];
      std::memcpy(to, samples.bytes + first * sample, row_bytes);
      to += row_bytes;
    }
  }
  array_.bytes = copy_.data();
}

void CroppedSamples::round() {
  const std::uint64_t count = std::uint64_t{array_.dims[0]} * array_.dims[1] * array_.dims[2];
  rounded_.resize_for_overwrite(count);
  with_sample(array_.type, [&](auto sample) {
    using Sample = decltype(sample);
    if constexpr (std::is_floating_point_v<Sample>) {
      const auto* first = reinterpret_cast<const Sample*>(array_.bytes);
      is_rounded_ = volume::round_labels(std::span(first, count), rounded_.data());
    }
  });
  copy_ = {};  // a buffer that shrinks keeps its memory
  array_.type = SampleType::kInt32;
  array_.bytes = reinterpret_cast<const std::byte*>(rounded_.data());
}

}  // namespace isomesh::jobs
