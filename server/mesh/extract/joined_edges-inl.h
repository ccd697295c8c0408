// Rows of bits that tell which crossed edges belong to a cluster. Compiled once for each
// instruction set, see slabs.cpp.
#if defined(ISOMESH_JOINED_EDGES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_JOINED_EDGES_INL_H_
#undef ISOMESH_JOINED_EDGES_INL_H_
#else
#define ISOMESH_JOINED_EDGES_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/clusters.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/slabs.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The edges that 64 samples own, by place: those whose crossing belongs to a cluster of the first
// end, and of the second.
template <std::size_t kPlaces>
struct JoinedWords {
  std::array<Word, kPlaces> first = {};
  std::array<Word, kPlaces> second = {};
};

// `kKinds`: how many rows of points that join crossings belong to each row of samples.
template <std::size_t kPlaces, std::size_t kKinds>
class JoinedEdges {
 public:
  using Words = JoinedWords<kPlaces>;

  JoinedEdges(const Dims& dims, std::uint32_t first, const LinksOfKinds<kKinds>& links)
      : rows_in_plane_(dims.y),
        rows_(2 * std::size_t{dims.y} + 4),
        words_(words_of(dims.x)),
        links_(links),
        edges_(rows_ * (words_ + 1)),
        next_row_(std::size_t{first} * dims.y) {}

  // The words of a row and one more of zeros, valid when mark() has reached the next row of the
  // next plane, until the one after that.
  const Words* row(std::uint32_t y, std::uint32_t z) const {
    return at(std::size_t{z} * rows_in_plane_ + y);
  }

  // Marks what the clusters of all rows up to (y + 1, z + 1) join. To be called row by row.
  void mark(std::span<const ClusterLayer> clusters, std::uint32_t y, std::uint32_t z) {
    const std::size_t last = std::size_t{z + 1} * rows_in_plane_ + y + 1;
    for (; next_row_ <= last; ++next_row_) {
      std::fill_n(at(next_row_), words_, Words{});
      const std::size_t plane = next_row_ / rows_in_plane_;
      if (plane >= clusters.size()) continue;
      const std::size_t row = next_row_ % rows_in_plane_ * kKinds;
      for (std::size_t kind = 0; kind < kKinds; ++kind) {
        for (const JoiningWord& word : clusters[plane].row(row + kind)) {
          mark_word(clusters[plane], word, *links_[kind]);
        }
      }
    }
  }

 private:
  // Samples own some of the edges around the samples after them in each direction.
  void mark_word(const ClusterLayer& layer, const JoiningWord& word, const Links& links) {
    std::array<BitBytes, (kMostDirections + 7) / 8> bytes = {};
    visit_joining(layer, word, [&](unsigned bit, const Joined& joined) {
      for (std::size_t i = 0; i < bytes.size(); ++i) {
        bytes[i][bit] = static_cast<std::uint8_t>(joined.directions() >> (8 * i));
      }
    });
    const auto directions = links.directions();
    const std::array rows = {at(next_row_), at(next_row_ - 1), at(next_row_ - rows_in_plane_),
                             at(next_row_ - rows_in_plane_ - 1)};
    for (std::size_t begin = 0; begin < directions.size(); begin += 8) {
      const BitWords words = transpose(bytes[begin / 8]);
      for (std::size_t d = begin; d < std::min(begin + 8, directions.size()); ++d) {
        const LinkDirection& direction = directions[d];
        Words* owners = rows[direction.corner >> 1] + word.word;
        const auto mark = [&](Words& edges, Word bits) {
          (direction.is_end ? edges.second : edges.first)[direction.place] |= bits;
        };
        const Word bits = words[d - begin];
        if ((direction.corner & 1) == 0) {
          mark(*owners, bits);
        } else {
          mark(*owners, bits >> 1);
          if (word.word != 0) mark(*(owners - 1), bits << 63);
        }
      }
    }
  }

  const Words* at(std::size_t row) const { return &edges_[row % rows_ * (words_ + 1)]; }
  Words* at(std::size_t row) { return &edges_[row % rows_ * (words_ + 1)]; }

  const std::size_t rows_in_plane_;
  const std::size_t rows_;  // as many as are needed, from the cells' row to the last one marked
  const std::size_t words_;
  const LinksOfKinds<kKinds> links_;
  std::vector<Words> edges_;
  std::size_t next_row_;  // the first that is not marked
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
