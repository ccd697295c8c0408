// Which crossings of a surface are joined into one vertex; see links.h for the rule.
#pragma once

#include <cstdint>
#include <vector>

namespace isomesh::mesh {

// A sample that joins crossings.
struct JoiningSample {
  static constexpr std::uint32_t kSeveral = std::uint32_t{1} << 31;

  std::uint32_t x = 0;
  // In which directions (links.h), and kSeveral if those are more than one component.
  std::uint32_t directions = 0;
};

// What one plane's samples join. Empty where they join nothing.
struct ClusterLayer {
  std::vector<JoiningSample> samples;    // row by row
  std::vector<std::uint32_t> row_begin;  // how many those are before each row, and all

  // What vanishes from the layer below, whose samples own some of the edges.
  std::uint64_t vertices_below = 0;
  std::uint64_t triangles_below = 0;
};

}  // namespace isomesh::mesh
