// Exact distances from points to triangles by brute force, written without the kernels.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace isomesh::test {

struct TriangleSoup {
  std::vector<std::array<std::array<double, 3>, 3>> triangles;
};

// From a point to the nearest of the triangles; infinite where there are none.
double distance_to(const std::array<double, 3>& point, const TriangleSoup& soup);

// The largest distance of about `points` random points of `from`, spread by the square root of area
// so that small triangles get some too, and of its corners and centres, from `to`.
double largest_distance(const TriangleSoup& from, const TriangleSoup& to, std::size_t points,
                        std::uint32_t seed);

}  // namespace isomesh::test
