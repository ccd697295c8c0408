// Which crossings of a surface are joined into one vertex; see links.h for the rule.
#pragma once

#include <cstdint>
#include <vector>

namespace isomesh::mesh {

// A sample that joins crossings.
struct JoiningSample {
  static constexpr std::uint32_t kSeveral = std::uint32_t{1} << 31;
  static constexpr std::uint32_t kJunction = std::uint32_t{1} << 30;
  static constexpr std::uint32_t kFlags = kSeveral | kJunction;

  std::uint32_t x = 0;
  // In which directions (links.h); kSeveral if those are more than one component, and kJunction if
  // points where more than two labels meet are joined with the crossings.
  std::uint32_t directions = 0;
};

// The points that such a sample of a junction joins with its crossings; a bit for each place in the
// lists of star_points.h.
struct JoinedPoints {
  std::uint64_t faces = 0;
  std::uint64_t centres = 0;
};

// What one plane's samples join. Empty where they join nothing.
struct ClusterLayer {
  std::vector<JoiningSample> samples;    // row by row
  std::vector<std::uint32_t> row_begin;  // how many those are before each row, and all

  // The points of those samples that are at junctions, in their order.
  std::vector<JoinedPoints> points;
  std::vector<std::uint32_t> points_begin;  // how many those are before each row

  // What vanishes from the layer below, whose samples own some of the edges.
  std::uint64_t vertices_below = 0;
  std::uint64_t triangles_below = 0;
};

}  // namespace isomesh::mesh
