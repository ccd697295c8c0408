#include "tests/bench/label_shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/bench/label_body.h"
#include "tests/support/points.h"

namespace isomesh::bench {
namespace {

using std::numbers::pi;
using test::cross;
using test::dot;
using test::length;
using test::minus;

// Three axes at right angles to each other, none of them special to the lattice.
constexpr ShapePoint kAxis = {0.48, 0.36, 0.8};
constexpr ShapePoint kAcross = {0.6, -0.8, 0};
const ShapePoint kThird = cross(kAxis, kAcross);

struct Frame {
  double radius = 0;
  ShapePoint spacing;
  ShapePoint centre;

  ShapePoint from_centre(const ShapePoint& p) const { return minus(p, centre); }
};

ShapePoint times(double factor, const ShapePoint& p) {
  return {factor * p[0], factor * p[1], factor * p[2]};
}

LabelShape ball(const Frame& frame) {
  const auto outside = [=](const ShapePoint& p) {
    return length(frame.from_centre(p)) - frame.radius;
  };
  return {.label = [=](const ShapePoint& p) { return outside(p) <= 0 ? 1 : 0; },
          .reach = frame.radius,
          .distance = [=](const ShapePoint& p,
                          const ShapeSides& /*sides*/) { return std::abs(outside(p)); },
          .areas = {{{0, 1}, 4 * pi * frame.radius * frame.radius}}};
}

// A ring around an axis that is oblique to the lattice.
LabelShape tube(const Frame& frame) {
  const double ring = 2.5 * frame.radius;
  const auto outside = [=](const ShapePoint& p) {
    const ShapePoint from = frame.from_centre(p);
    const double along = dot(from, kAxis);
    return std::hypot(along, length(minus(from, times(along, kAxis))) - ring) - frame.radius;
  };
  return {.label = [=](const ShapePoint& p) { return outside(p) <= 0 ? 1 : 0; },
          .reach = ring + frame.radius,
          .distance = [=](const ShapePoint& p,
                          const ShapeSides& /*sides*/) { return std::abs(outside(p)); },
          .areas = {{{0, 1}, 4 * pi * pi * ring * frame.radius}}};
}

LabelShape box_of(const std::array<ShapePoint, 3>& axes, const ShapePoint& centre,
                  const ShapePoint& half, const ShapePoint& sample) {
  const auto beyond = [=](const ShapePoint& p) {
    ShapePoint of;
    for (std::size_t i = 0; i < 3; ++i) {
      of[i] = std::abs(dot(minus(p, centre), axes[i])) - half[i];
    }
    return of;
  };
  const auto distance = [=](const ShapePoint& p, const ShapeSides& /*sides*/) {
    ShapePoint out = beyond(p);
    const double most = std::ranges::max(out);
    if (most <= 0) return -most;
    for (double& each : out) each = std::max(each, 0.0);
    return length(out);
  };
  const auto from_face = [=](const ShapePoint& p) -> std::optional<double> {
    constexpr double kFromEdges = 3;  // samples
    const ShapePoint of = beyond(p);
    std::size_t face = 0;
    for (std::size_t i = 1; i < 3; ++i) {
      if (std::abs(of[i]) / sample[i] < std::abs(of[face]) / sample[face]) face = i;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      if (i != face && of[i] > -kFromEdges * sample[i]) return std::nullopt;
    }
    return std::abs(of[face]) / sample[face];
  };
  return {.label = [=](const ShapePoint& p) { return std::ranges::max(beyond(p)) <= 0 ? 1 : 0; },
          .reach = length(half),
          .distance = distance,
          .from_face = from_face,
          .areas = {{{0, 1}, 8 * (half[0] * half[1] + half[1] * half[2] + half[0] * half[2])}}};
}

// With faces half-way between samples.
LabelShape box(const Frame& frame) {
  ShapePoint half = {frame.radius, 0.9 * frame.radius, 0.8 * frame.radius};
  for (std::size_t i = 0; i < 3; ++i) {
    half[i] = (std::floor(half[i] / frame.spacing[i]) + 0.5) * frame.spacing[i];
  }
  return box_of({ShapePoint{1, 0, 0}, ShapePoint{0, 1, 0}, ShapePoint{0, 0, 1}}, {0, 0, 0}, half,
                frame.spacing);
}

LabelShape tilted_box(const Frame& frame) {
  const double sample = std::cbrt(frame.spacing[0] * frame.spacing[1] * frame.spacing[2]);
  return box_of({kAcross, kThird, kAxis}, frame.centre,
                {frame.radius, 0.9 * frame.radius, 0.8 * frame.radius}, {sample, sample, sample});
}

LabelShape voxel(const Frame& frame) {
  const auto label = [=](const ShapePoint& p) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (std::abs(p[i]) > 0.5 * frame.spacing[i]) return 0;
    }
    return 1;
  };
  return {.label = label, .reach = std::ranges::max(frame.spacing)};
}

// One sample thick, or 1.5 where it is oblique.
LabelShape sheet(const Frame& frame, const ShapePoint& normal) {
  const ShapePoint scaled = {normal[0] * frame.spacing[0], normal[1] * frame.spacing[1],
                             normal[2] * frame.spacing[2]};
  const bool is_oblique = normal == kAxis;
  const ShapePoint centre = is_oblique ? frame.centre : ShapePoint{};
  const double half = (is_oblique ? 0.75 : 0.5) * length(scaled);
  const auto label = [=](const ShapePoint& p) {
    const ShapePoint from = minus(p, centre);
    const double along = dot(from, normal);
    return std::abs(along) <= half && length(minus(from, times(along, normal))) <= frame.radius ? 1
                                                                                                : 0;
  };
  return {.label = label, .reach = frame.radius};
}

// One row of samples, or 0.9 of the largest spacing in radius where it is oblique.
LabelShape thread(const Frame& frame, const ShapePoint& axis) {
  const bool is_oblique = axis == kAxis;
  const auto label = [=](const ShapePoint& p) {
    if (is_oblique) {
      const ShapePoint from = frame.from_centre(p);
      const double along = dot(from, axis);
      const double most = 0.9 * std::ranges::max(frame.spacing);
      return std::abs(along) <= frame.radius && length(minus(from, times(along, axis))) <= most ? 1
                                                                                                : 0;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const double most = axis[i] != 0 ? frame.radius : 0.5 * frame.spacing[i];
      if (std::abs(p[i]) > most) return 0;
    }
    return 1;
  };
  return {.label = label, .reach = frame.radius};
}

// A ball of two labels.
LabelShape halves(const Frame& frame) {
  const double r = frame.radius;
  const auto label = [=](const ShapePoint& p) {
    const ShapePoint from = frame.from_centre(p);
    if (length(from) > r) return 0;
    return dot(from, kAxis) > 0 ? 2 : 1;
  };
  const auto distance = [=](const ShapePoint& p, const ShapeSides& sides) {
    const ShapePoint from = frame.from_centre(p);
    return sides.first == 0 ? std::abs(length(from) - r) : std::abs(dot(from, kAxis));
  };
  return {.label = label,
          .reach = r,
          .distance = distance,
          .areas = {{{1, 2}, pi * r * r}, {{0, 1}, 2 * pi * r * r}, {{0, 2}, 2 * pi * r * r}},
          .curve_length = 2 * pi * r};
}

// A ball of three labels that meet in its axis.
LabelShape sectors(const Frame& frame) {
  constexpr double kAngle = 2 * pi / 3;
  const double r = frame.radius;
  const auto turn = [=](const ShapePoint& from) {
    const double angle = std::atan2(dot(from, kThird), dot(from, kAcross));
    return angle < 0 ? angle + 2 * pi : angle;
  };
  const auto label = [=](const ShapePoint& p) {
    const ShapePoint from = frame.from_centre(p);
    if (length(from) > r) return 0;
    return 1 + std::min(2, static_cast<int>(turn(from) / kAngle));
  };
  const auto distance = [=](const ShapePoint& p, const ShapeSides& sides) {
    const ShapePoint from = frame.from_centre(p);
    if (sides.first == 0) return std::abs(length(from) - r);
    // The half plane between two sectors ends in the axis.
    const double angle = kAngle * (sides == ShapeSides{1, 2} ? 1 : sides.first == 2 ? 2 : 0);
    const ShapePoint ray = minus(times(std::cos(angle), kAcross), times(-std::sin(angle), kThird));
    const ShapePoint flat = minus(from, times(dot(from, kAxis), kAxis));
    return length(minus(flat, times(std::max(0.0, dot(flat, ray)), ray)));
  };
  LabelShape shape = {
      .label = label, .reach = r, .distance = distance, .curve_length = 2 * r + 3 * pi * r};
  for (int a = 1; a <= 3; ++a) {
    shape.areas[{0, a}] = 4 * pi * r * r / 3;
    for (int b = a + 1; b <= 3; ++b) shape.areas[{a, b}] = pi * r * r / 2;
  }
  return shape;
}

using Maker = std::function<LabelShape(const Frame&)>;

const std::map<std::string, Maker>& makers() {
  const ShapePoint along_x = {1, 0, 0};
  const ShapePoint along_z = {0, 0, 1};
  static const std::map<std::string, Maker> all = {
      {"ball", ball},
      {"tube", tube},
      {"box", box},
      {"tilted box", tilted_box},
      {"voxel", voxel},
      {"sheet across x", [=](const Frame& frame) { return sheet(frame, along_x); }},
      {"sheet across z", [=](const Frame& frame) { return sheet(frame, along_z); }},
      {"tilted sheet", [=](const Frame& frame) { return sheet(frame, kAxis); }},
      {"thread along x", [=](const Frame& frame) { return thread(frame, along_x); }},
      {"thread along z", [=](const Frame& frame) { return thread(frame, along_z); }},
      {"tilted thread", [=](const Frame& frame) { return thread(frame, kAxis); }},
      {"halves", halves},
      {"sectors", sectors},
  };
  return all;
}

}  // namespace

LabelShape label_shape(const std::string& name, double radius, const ShapePoint& spacing,
                       std::size_t place) {
  ShapePoint centre = even_point(place);
  for (std::size_t i = 0; i < 3; ++i) centre[i] = (centre[i] - 0.5) * spacing[i];
  return makers().at(name)({radius, spacing, centre});
}

Samples sample_shape(const LabelShape& shape, const ShapePoint& spacing) {
  Samples samples;
  std::uint32_t* const counts[] = {&samples.dims.x, &samples.dims.y, &samples.dims.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto half = static_cast<std::uint32_t>(std::ceil(shape.reach / spacing[axis])) + 4;
    *counts[axis] = 2 * half + 1;
    samples.geometry.spacing[axis] = spacing[axis];
    samples.geometry.origin[axis] = -static_cast<double>(half) * spacing[axis];
  }
  for (std::uint32_t k = 0; k < samples.dims.z; ++k) {
    for (std::uint32_t j = 0; j < samples.dims.y; ++j) {
      for (std::uint32_t i = 0; i < samples.dims.x; ++i) {
        const std::array<std::uint32_t, 3> index = {i, j, k};
        ShapePoint at;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          at[axis] = samples.geometry.origin[axis] + index[axis] * spacing[axis];
        }
        samples.bytes.push_back(static_cast<std::byte>(shape.label(at)));
      }
    }
  }
  return samples;
}

}  // namespace isomesh::bench
