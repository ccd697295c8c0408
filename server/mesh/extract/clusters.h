// The crossings of a surface that are joined into one vertex; see links.h for the rule.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace isomesh::mesh {

// The directions (links.h) whose crossings a sample joins, and flags.
struct Joined {
  static constexpr std::uint32_t kSeveral = std::uint32_t{1} << 31;
  static constexpr std::uint32_t kJunction = std::uint32_t{1} << 30;
  static constexpr std::uint32_t kWhole = std::uint32_t{1} << 29;
  static constexpr std::uint32_t kFlags = kSeveral | kJunction | kWhole;

  // kSeveral if the directions are more than one component, kJunction if points where more than two
  // labels meet are joined with the crossings, and kWhole if a sample with one other label around
  // it joins all crossings that it owns.
  std::uint32_t bits = 0;

  std::uint32_t directions() const { return bits & ~kFlags; }
  bool is_one() const { return (bits & kSeveral) == 0; }
  bool is_junction() const { return (bits & kJunction) != 0; }
  bool is_whole() const { return (bits & kWhole) != 0; }
};

// Those of 64 samples of a row that join crossings.
struct JoiningWord {
  std::uint64_t samples = 0;  // a bit each
  std::uint32_t word = 0;     // bit 0 is the sample x = 64 * word
  std::uint32_t first = 0;    // where their directions begin in ClusterLayer::joined
};

// The points in faces, and the centres, that such a sample of a junction joins with its crossings;
// a bit for each place in the lists of star_points.h.
using JoinedPoints = std::array<std::uint64_t, 2>;

// The joined crossings of one plane of samples. Empty if there are none. On the body-centred
// lattice a row of samples and a row of centres follow each other.
struct ClusterLayer {
  std::vector<JoiningWord> words;        // row by row
  std::vector<std::uint32_t> row_begin;  // how many words are before each row, and all
  std::vector<Joined> joined;            // what each sample joins, in their order

  // The points of those samples that are at junctions, in their order.
  std::vector<JoinedPoints> points;
  std::vector<std::uint32_t> points_begin;  // how many those are before each row

  // How much vanishes from the layer below, whose samples own some of the edges.
  std::uint64_t vertices_below = 0;
  std::uint64_t triangles_below = 0;

  std::span<const JoiningWord> row(std::size_t row) const {
    if (words.empty()) return {};
    return std::span(words).subspan(row_begin[row], row_begin[row + 1] - row_begin[row]);
  }
};

// Calls visit(bit, what it joins) for the samples of a word.
template <class Visit>
void visit_joining(const ClusterLayer& layer, const JoiningWord& word, Visit visit) {
  const Joined* joined = layer.joined.data() + word.first;
  for (std::uint64_t rest = word.samples; rest != 0; rest &= rest - 1) {
    visit(static_cast<unsigned>(std::countr_zero(rest)), *joined++);
  }
}

}  // namespace isomesh::mesh
