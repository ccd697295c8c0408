// Which crossings of a surface are joined into one vertex; see links.h for the rule.
#pragma once

#include <cstdint>
#include <vector>

namespace isomesh::mesh {

// What one plane's samples join. Empty where they join nothing.
struct ClusterLayer {
  // Row by row, 64 samples a word: which samples join crossings.
  std::vector<std::uint64_t> samples;
  // How many those are in the rows before each row, and one more for all.
  std::vector<std::uint32_t> row_begin;
  // The directions in which each of them joins crossings (links.h), in the samples' order.
  std::vector<std::uint32_t> directions;

  // What vanishes from the layer below, whose samples own some of the edges.
  std::uint64_t vertices_below = 0;
  std::uint64_t triangles_below = 0;
};

}  // namespace isomesh::mesh
