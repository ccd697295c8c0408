// Triangles that can be compared whatever their vertices are numbered as.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

namespace isomesh::test {

using Place = std::array<float, 3>;

// A triangle by where its corners lie.
using PlacedTriangle = std::array<Place, 3>;

// From the smallest corner on, in its own sense of rotation.
inline PlacedTriangle turned(PlacedTriangle triangle) {
  std::array<PlacedTriangle, 3> turns;
  for (PlacedTriangle& turn : turns) {
    turn = triangle;
    // Clang 14 cannot compile std::ranges::rotate of g++ 12.
    std::rotate(triangle.begin(), triangle.begin() + 1, triangle.end());
  }
  return std::ranges::min(turns);
}

// All of them, in an order of their own. `points` are found by the numbers that triangles hold.
template <class Points, class Triangles>
std::vector<PlacedTriangle> placed(const Points& points, const Triangles& triangles) {
  std::vector<PlacedTriangle> result;
  for (const auto& [a, b, c] : triangles) {
    result.push_back(turned({points[a], points[b], points[c]}));
  }
  std::ranges::sort(result);
  return result;
}

}  // namespace isomesh::test
