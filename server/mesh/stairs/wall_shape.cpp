#include "server/mesh/stairs/wall_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "server/mesh/points.h"

namespace isomesh::mesh {

WallShape::WallShape(const SeparatingSurface& surface, const Dims& dims,
                     const LatticeToSpace& to_space, bool closed, const Context& context)
    : closed_(closed) {
  place(surface, dims, to_space, context);
  fans_ = WallFans(surface, closed_ ? flags_.span() : std::span<std::uint8_t>(), context);
  find_neighbors(context);
}

namespace {

// The distance of a vertex from the face that it lies in, at most, in samples along each axis: far
// from the origin, steps of single precision are no small part of a sample.
class NearFace {
 public:
  explicit NearFace(const LatticeToSpace& to_space) {
    const std::array<Point, 3> steps = {to_space.step_x, to_space.step_y, to_space.step_z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Point across = cross(steps[(axis + 1) % 3], steps[(axis + 2) % 3]);
      per_mm_[axis] = std::sqrt(dot(across, across)) / std::abs(to_space.determinant());
    }
  }

  double of(const Vec3& position, std::size_t axis) const {
    constexpr double kLeast = 1e-3;
    constexpr double kMost = 0.2;  // other vertices are farther
    double rounding_mm = 0;
    for (const float at : position) {
      rounding_mm += std::abs(at) * double{std::numeric_limits<float>::epsilon()};
    }
    return std::clamp(rounding_mm * per_mm_[axis], kLeast, kMost);
  }

 private:
  std::array<double, 3> per_mm_ = {};  // samples
};

}  // namespace

void WallShape::place(const SeparatingSurface& surface, const Dims& dims,
                      const LatticeToSpace& to_space, const Context& context) {
  const std::array<Point, 3> steps = {to_space.step_x, to_space.step_y, to_space.step_z};
  const double unit = unit_mm(to_space);
  for (int axis = 0; axis < 3; ++axis) {
    const Point& step = steps[static_cast<std::size_t>(axis)];
    spacing_[axis] = static_cast<float>(std::sqrt(dot(step, step)) / unit);
  }
  largest_spacing_ = std::max({spacing_[0], spacing_[1], spacing_[2]});
  smallest_spacing_ = std::min({spacing_[0], spacing_[1], spacing_[2]});
  sample_ = spacing_;
  if (to_space.determinant() < 0) spacing_[0] = -spacing_[0];

  const Mesh& mesh = surface.mesh;
  blocks_ = {0};
  for (const std::uint64_t first : mesh.layer_vertices) {
    constexpr std::size_t kBlock = 2048;  // what some of them take stays in a cache of a mebibyte
    if (first >= blocks_.back() + kBlock) blocks_.push_back(first);
  }
  if (blocks_.size() > 1) blocks_.pop_back();  // the last takes what is left
  blocks_.push_back(mesh.positions.size());
  const std::array<std::uint32_t, 3> samples = {dims.x, dims.y, dims.z};
  start_.resize_for_overwrite(mesh.positions.size());
  flags_.resize_for_overwrite(mesh.positions.size());
  at.resize_for_overwrite(mesh.positions.size());
  // Caps lie half a step beyond the outermost samples, the ends of an open wall in them.
  const double beyond = closed_ ? 0.5 : 0;
  const auto lane = [&](std::size_t axis) {
    return static_cast<float>(samples[axis] - 1 + beyond);
  };
  const Lanes near = static_cast<float>(-beyond) * spacing_;
  const Lanes far = Lanes{lane(0), lane(1), lane(2), 0} * spacing_;
  low_ = smaller(near, far);
  high_ = larger(near, far);
  const NearFace near_face(to_space);
  for_each(context, mesh.positions.size(), [&](std::size_t v) {
    const auto index = index_of(to_space, to_point(mesh.positions[v]));
    std::uint8_t axes = 0;
    start_[v] = Lanes{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      start_[v][static_cast<int>(axis)] = static_cast<float>(index[axis]);
      const double last = samples[axis] - 1 + beyond;
      const double least = near_face.of(mesh.positions[v], axis);
      const bool is_in_face =
          std::abs(index[axis] + beyond) < least || std::abs(index[axis] - last) < least;
      if (is_in_face) axes |= static_cast<std::uint8_t>(1U << axis);
    }
    at[v] = start_[v] *= spacing_;
    flags_[v] = !closed_ || mesh.is_on_border(v) ? axes : 0;
  });
}

// Those with which other than two triangles join a vertex, of walls or of caps.
void WallShape::list_along_curves(std::size_t v, std::vector<std::uint32_t>& found) const {
  std::vector<std::pair<std::uint32_t, bool>> ends;  // of triangles, and whether those are caps
  visit_triangles(v, [&](std::size_t fan, std::uint32_t a, std::uint32_t b) {
    const bool is_cap = fans_.wall(fan).is_cap;
    ends.emplace_back(a, is_cap);
    ends.emplace_back(b, is_cap);
  });
  std::ranges::sort(ends);
  for (auto begin = ends.begin(), end = begin; begin != ends.end(); begin = end) {
    end = std::find_if(begin, ends.end(), [&](const auto& other) { return other != *begin; });
    const std::uint32_t neighbor = begin->first;
    if (end - begin != 2 && (found.empty() || found.back() != neighbor)) found.push_back(neighbor);
  }
}

void WallShape::find_neighbors(const Context& context) {
  const auto is_within_one_wall = [&](std::size_t v) {
    return fans_.begin(v + 1) - fans_.begin(v) == 1 && fans_.is_closed(fans_.begin(v));
  };
  neighbors_ = NeighborLists(vertices(), context, [&](std::size_t v, auto& list) {
    if (!is_within_one_wall(v)) list_along_curves(v, list);
    if (!list.empty()) {
      flags_[v] |= kCurve;
      return;
    }
    // Each neighbour of another is the first of these in one triangle.
    visit_triangles(v, [&](std::size_t, std::uint32_t a, std::uint32_t) { list.push_back(a); });
  });
}

}  // namespace isomesh::mesh
