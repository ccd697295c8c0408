#include "tests/unit/mesh/cgal_triangles.h"

#include <algorithm>
#include <array>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

namespace isomesh::test {
namespace {

using mesh::Triangle;
using mesh::Vec3;

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point3 = Kernel::Point_3;
using Segment3 = Kernel::Segment_3;
using Triangle3 = Kernel::Triangle_3;

Point3 point_of(const Vec3& v) { return {double{v[0]}, double{v[1]}, double{v[2]}}; }

Triangle3 triangle_of(std::span<const Vec3> positions, const Triangle& t) {
  return {point_of(positions[t[0]]), point_of(positions[t[1]]), point_of(positions[t[2]])};
}

// With the shared vertices first, which keeps what a triangle is as a set.
Triangle shared_first(const Triangle& triangle, const Triangle& other) {
  Triangle result = triangle;
  // std::ranges' returns a range of a kind that clang++ 14 cannot compile with g++ 12's library.
  std::stable_partition(result.begin(), result.end(), [&](std::uint32_t vertex) {
    return std::ranges::find(other, vertex) != other.end();
  });
  return result;
}

// True if two triangles that share their first vertex also intersect elsewhere. Then one of them
// intersects the edge of the other that is opposite that vertex.
bool meet_beyond_vertex(std::span<const Vec3> positions, const Triangle& a, const Triangle& b) {
  const auto far_side = [&](const Triangle& t) {
    return Segment3(point_of(positions[t[1]]), point_of(positions[t[2]]));
  };
  return CGAL::do_intersect(triangle_of(positions, a), far_side(b)) ||
         CGAL::do_intersect(triangle_of(positions, b), far_side(a));
}

// Along a common edge two triangles meet nowhere else, unless one lies upon the other.
bool overlap_at_edge(std::span<const Vec3> positions, const Triangle& a, const Triangle& b) {
  const Point3 from = point_of(positions[a[0]]);
  const Point3 to = point_of(positions[a[1]]);
  const Point3 left = point_of(positions[a[2]]);
  const Point3 right = point_of(positions[b[2]]);
  return CGAL::orientation(from, to, left, right) == CGAL::COPLANAR &&
         CGAL::coplanar_orientation(from, to, left, right) == CGAL::POSITIVE;
}

}  // namespace

bool is_flat_for_cgal(std::span<const Vec3> positions, const Triangle& triangle) {
  return CGAL::collinear(point_of(positions[triangle[0]]), point_of(positions[triangle[1]]),
                         point_of(positions[triangle[2]]));
}

bool do_intersect_for_cgal(std::span<const Vec3> positions, const Triangle& a, const Triangle& b) {
  const auto shared = std::ranges::count_if(
      a, [&](std::uint32_t vertex) { return std::ranges::find(b, vertex) != b.end(); });
  switch (shared) {
    case 0:
      return CGAL::do_intersect(triangle_of(positions, a), triangle_of(positions, b));
    case 1:
      return meet_beyond_vertex(positions, shared_first(a, b), shared_first(b, a));
    case 2: {
      Triangle other = shared_first(b, a);
      const Triangle first = shared_first(a, b);
      if (other[0] != first[0]) std::swap(other[0], other[1]);
      return overlap_at_edge(positions, first, other);
    }
    default:
      return true;
  }
}

}  // namespace isomesh::test
