// Rows of bits that tell which vertices of a row's samples belong to a cluster. Compiled once for
// each instruction set, see slabs.cpp.
#if defined(ISOMESH_JOINED_ROWS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_JOINED_ROWS_INL_H_
#undef ISOMESH_JOINED_ROWS_INL_H_
#else
#define ISOMESH_JOINED_ROWS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/clusters.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// Calls visit(x, what it joins, its points or null) for the samples of a row of plane z that join
// crossings.
template <class Visit>
void visit_joining(std::span<const ClusterLayer> clusters, std::uint32_t row, std::uint32_t z,
                   Visit visit) {
  if (z >= clusters.size() || clusters[z].words.empty()) return;
  const ClusterLayer& layer = clusters[z];
  const JoinedPoints* points = layer.points.data() + layer.points_begin[row];
  for (const JoiningWord& word : layer.row(row)) {
    visit_joining(layer, word, [&](unsigned bit, const Joined& joined) {
      visit(word.word * kWordBits + bit, joined, joined.is_junction() ? points++ : nullptr);
    });
  }
}

// The place of the name of a vertex beside a sample: one of the rows (y, z), (y - 1, z), (y, z - 1)
// and (y - 1, z - 1), the number of samples before, and the slot there.
struct JoinedName {
  std::uint8_t row = 0;
  std::uint8_t before = 0;
  std::uint8_t place = 0;
};

struct JoiningPlace {
  std::uint32_t x = 0;
  std::uint32_t row = 0;
  std::uint32_t z = 0;
};

// `Places`: an integer with a bit for each place of a sample.
template <class Places>
class JoinedRows {
 public:
  JoinedRows(const Dims& dims, std::uint32_t first)
      : dims_(dims),
        rows_(std::size_t{dims.y} + 2),
        joined_(rows_ * dims.x),
        next_row_(std::size_t{first} * dims.y) {}

  // For each sample of the row the places of the vertices that some cluster has, after mark(y, z).
  const Places* row(std::uint32_t y, std::uint32_t z) const {
    return at(std::size_t{z} * dims_.y + y);
  }

  // Marks what the clusters of the rows around (y, z) join: the rest of that row then has vertices
  // of its own. `visit_names({x, row, z}, joined, points, visit)` tells the names of all that a
  // sample joins, of a row of plane z. To be called row by row.
  template <class VisitNames>
  void mark(std::span<const ClusterLayer> clusters, std::uint32_t y, std::uint32_t z,
            VisitNames visit_names) {
    const std::size_t last = std::size_t{z + 1} * dims_.y + y + 1;
    for (; next_row_ <= last; ++next_row_) {
      std::fill_n(at(next_row_), dims_.x, Places{0});
      const auto row_z = static_cast<std::uint32_t>(next_row_ / dims_.y);
      const auto row_y = static_cast<std::uint32_t>(next_row_ % dims_.y);
      const std::array<Places*, 4> rows = {at(next_row_), at(next_row_ - 1),
                                           at(next_row_ - dims_.y), at(next_row_ - dims_.y - 1)};
      visit_joining(clusters, row_y, row_z,
                    [&](std::uint32_t x, const Joined& joined, const JoinedPoints* points) {
                      visit_names({x, row_y, row_z}, joined, points, [&](const JoinedName& name) {
                        Places& places = rows[name.row][x - name.before];
                        places = static_cast<Places>(places | Places{1} << name.place);
                      });
                    });
    }
  }

 private:
  const Places* at(std::size_t row) const { return joined_.data() + row % rows_ * dims_.x; }
  Places* at(std::size_t row) { return joined_.data() + row % rows_ * dims_.x; }

  const Dims dims_;
  const std::size_t rows_;
  std::vector<Places> joined_;  // of each sample of the last rows that were marked
  std::size_t next_row_;        // the first that is not
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
