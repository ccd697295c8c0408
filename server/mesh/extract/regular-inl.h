// What the walk reads if the surface is regularised: the vertices of clusters, on any lattice, and
// the signs of five or six tetrahedra. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_REGULAR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_REGULAR_INL_H_
#undef ISOMESH_REGULAR_INL_H_
#else
#define ISOMESH_REGULAR_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/joined_edges-inl.h"
#include "server/mesh/extract/kept_triangles-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// A field whose clusters have vertices. In each row those come before the vertices of edges that no
// cluster has. `Field`: SignField or BccField.
template <class Field>
class ClusteredField : public Field {
 public:
  static constexpr bool kHasClusters = true;

  ClusteredField(const Extraction& extraction, std::uint32_t first)
      : Field(extraction, first),
        extraction_(extraction),
        links_(Field::links(extraction)),
        joined_(extraction.dims, first, links_),
        edges_(std::size_t{extraction.dims.x} * kMostDirections + kMembersRoom),
        numbers_(edges_.size()),
        sums_(extraction.dims.x * kMostComponents) {
    for (std::size_t kind = 0; kind < Field::kKinds; ++kind) {
      const auto directions = links_[kind]->directions();
      for (unsigned parity = 0; parity < 2; ++parity) {
        for (std::size_t d = 0; d < directions.size(); ++d) {
          const auto edge = Field::cluster_edge(parity, directions[d]);
          ends_[kind][parity * kRange + d] = edge.ends;
          frames_[kind][parity * kRange + d] = edge.frame;
        }
      }
    }
  }

  // Gives the clusters of a row the vertices from `vertex` on and writes those to the edges that
  // are joined; `rows` are the indices of the samples of the rows (y, z), (y - 1, z), (y, z - 1)
  // and (y - 1, z - 1). Places the vertices in `mesh` unless it is null. Returns the vertex behind
  // them. Afterwards row(y, z) can be asked for. To be called row by row.
  std::uint32_t number_clusters(std::uint32_t y, std::uint32_t z,
                                const std::array<std::uint32_t*, 4>& rows, std::uint32_t vertex,
                                Mesh* mesh) {
    joined_.mark(extraction_.clusters, y, z);
    if (z >= extraction_.clusters.size()) return vertex;
    for (std::size_t kind = 0; kind < Field::kKinds; ++kind) {
      list_clusters(kind, y, z, vertex);
      if (clusters_ == 0) continue;
      number_edges(kind, rows);
      if (mesh != nullptr) place_clusters(kind, y, z, vertex, mesh->positions.data());
      vertex += static_cast<std::uint32_t>(clusters_);
    }
    return vertex;
  }

 protected:
  // The edges that clusters have, of the samples of a row.
  const JoinedWords<Field::kJoinedPlaces>* joined(std::uint32_t y, std::uint32_t z) const {
    return joined_.row(y, z);
  }

  // The same for the four rows around a row of cells.
  std::array<const JoinedWords<Field::kJoinedPlaces>*, 4> joined_around(std::uint32_t y,
                                                                        std::uint32_t z) const {
    return {joined(y, z), joined(y + 1, z), joined(y, z + 1), joined(y + 1, z + 1)};
  }

 private:
  static constexpr std::uint32_t kRange = Field::kClusterPlaces;  // a point, for its directions
  static constexpr std::size_t kMembersRoom = 8;     // members are listed eight at a time
  static constexpr std::size_t kMostComponents = 9;  // of no two neighbours in a link

  // Lists the edges of the clusters of a row, cluster by cluster, and the vertices that they
  // become.
  void list_clusters(std::size_t kind, std::uint32_t y, std::uint32_t z, std::uint32_t vertex) {
    const ClusterLayer& layer = extraction_.clusters[z];
    const Links& links = *links_[kind];
    const auto directions = static_cast<unsigned>(links.directions().size());
    std::uint32_t* edge = edges_.data();
    std::uint32_t* number = numbers_.data();
    Sum* sum = sums_.data();
    const auto add = [&](std::uint32_t x, Directions component) {
      *sum++ = Sum{.edges = static_cast<double>(std::popcount(component)), .x = x};
      for (unsigned first = 0; first < directions; first += 8) {
        const unsigned set = component >> first & 0xFF;
        edge = list_members(x * kRange + first, set, edge);
        std::fill_n(number, 8, vertex);
        number += std::popcount(set);
      }
      ++vertex;
    };
    for (const JoiningWord& word : layer.row(std::size_t{y} * Field::kKinds + kind)) {
      visit_joining(layer, word, [&](unsigned bit, const Joined& joined) {
        const std::uint32_t x = word.word * kWordBits + bit;
        if (joined.is_one()) return add(x, joined.directions());
        for (Directions rest = joined.directions(); rest != 0;) {
          const Directions component = links.facts(extraction_.parity(x, y, z), rest).first();
          rest &= ~component;
          add(x, component);
        }
      });
    }
    found_ = static_cast<std::size_t>(edge - edges_.data());
    clusters_ = static_cast<std::size_t>(sum - sums_.data());
  }

  // Tells the edges of those clusters their vertices.
  void number_edges(std::size_t kind, const std::array<std::uint32_t*, 4>& rows) {
    std::uint32_t* here = rows[0];
    std::array<std::ptrdiff_t, kMostDirections> places = {};  // from the sample's first
    const auto directions = links_[kind]->directions();
    for (std::size_t d = 0; d < directions.size(); ++d) {
      const std::ptrdiff_t before = directions[d].corner & 1;
      places[d] = rows[directions[d].corner >> 1] - here + directions[d].place -
                  before * std::ptrdiff_t{Field::kPlaces};
    }
    for (std::size_t i = 0; i < found_; ++i) {
      const std::ptrdiff_t sample = edges_[i] / kRange * std::ptrdiff_t{Field::kPlaces};
      here[sample + places[edges_[i] % kRange]] = numbers_[i];
    }
  }

  // The means of the crossings of each cluster, the first of which is `vertex`.
  void place_clusters(std::size_t kind, std::uint32_t y, std::uint32_t z, std::uint32_t vertex,
                      Vec3* positions) {
    const std::uint32_t margin = extraction_.margin;
    shares_.resize(std::max(shares_.size(), found_));
    Field::cluster_shares(y, z, ends_[kind].data(), std::span(edges_).first(found_),
                          shares_.data());
    const unsigned row_parity = extraction_.parity(0, y, z);
    for (std::size_t i = 0; i < found_; ++i) {
      const std::uint32_t x = edges_[i] / kRange;
      const EdgeFrame& frame = frames_[kind][((x ^ row_parity) & 1) * kRange + edges_[i] % kRange];
      sums_[numbers_[i] - vertex].points += frame.start + frame.run * shares_[i];
    }
    const LatticeToSpace& map = extraction_.to_space;
    const Double4 row_at = row_origin(map, y - margin, z - margin);
    for (std::size_t cluster = 0; cluster < clusters_; ++cluster) {
      const Sum& sum = sums_[cluster];
      const Double4 at = row_at + lanes(map.step_x) * static_cast<double>(sum.x - margin);
      const Float4 position = __builtin_convertvector(at + sum.points / sum.edges, Float4);
      std::memcpy(positions + vertex + cluster, &position, sizeof *positions);
    }
  }

  // The sum of a cluster's crossings, relative to the sample at x, and their number.
  struct Sum {
    StoredDouble4 points = {};
    double edges = 0;
    std::uint32_t x = 0;
  };

  const Extraction& extraction_;
  const LinksOfKinds<Field::kKinds> links_;
  JoinedEdges<Field::kJoinedPlaces, Field::kKinds> joined_;
  // By kind, then by parity and direction.
  std::array<std::array<typename Field::Ends, std::size_t{2} * kRange>, Field::kKinds> ends_ = {};
  std::array<std::array<EdgeFrame, std::size_t{2} * kRange>, Field::kKinds> frames_ = {};
  // The edges of the current row's clusters of one kind, cluster by cluster, as kRange * x +
  // direction, and the vertex that each becomes.
  std::vector<std::uint32_t> edges_;
  std::vector<std::uint32_t> numbers_;
  std::size_t found_ = 0;
  std::vector<double> shares_;  // of those edges
  std::vector<Sum> sums_;       // of the clusters
  std::size_t clusters_ = 0;
};

// SignCells, and for each sample the set of its edges that no cluster has.
struct RegularCells : SignCells {
  BitBytes lone;
};

// A row without the vertices that clusters have instead of its edges.
class RegularRow : public SignRow {
 public:
  RegularRow(const SignRow& row, const JoinedWords<kEdgePlaces>* joined)
      : SignRow(row), joined_(joined) {}

  Word describe(std::size_t w, RegularCells& cells) const {
    const CornerWords signs = corners(w);
    cells.crossed = crossed_cells(w, signs);
    cells.cases = transpose(signs);
    BitWords lone = crossed_edges(w, signs);
    Word owners = 0;
    for (std::size_t place = 0; place < kEdgePlaces; ++place) {
      lone[place] &= ~(joined_[w].first[place] | joined_[w].second[place]);
      owners |= lone[place];
    }
    if (owners != 0) cells.lone = transpose(lone);
    return owners;
  }

  HWY_INLINE static std::uint32_t* list(std::size_t x, unsigned bit, const RegularCells& cells,
                                        std::uint32_t* next) {
    return list_edges(x, cells.lone[bit], next);
  }

 private:
  const JoinedWords<kEdgePlaces>* joined_;
};

// The crossings around 64 cells that are joined. `rows`: of the samples at (y, z), (y + 1, z),
// (y, z + 1), (y + 1, z + 1).
struct JoinedCorners {
  // The cells whose crossing on the edge between two corners is joined at the first of them.
  template <unsigned kAt, unsigned kTo>
  HWY_INLINE Word at() const {
    constexpr unsigned kOwner = kAt & kTo;
    const JoinedWords<kEdgePlaces>* words = rows[kOwner >> 1] + w;
    const auto bits_of = [](const JoinedWords<kEdgePlaces>& edges) {
      // An edge's first end is its corner of the smaller number.
      return kAt < kTo ? edges.first[kAt ^ kTo] : edges.second[kAt ^ kTo];
    };
    const Word bits = bits_of(words[0]);
    return (kOwner & 1) == 0 ? bits : bits >> 1 | bits_of(words[1]) << 63;
  }

  const std::array<const JoinedWords<kEdgePlaces>*, 4>& rows;
  std::size_t w;
};

// Writes the triangles that are left of the cells of one row.
class RegularCellWriter {
 public:
  // `joined`: as JoinedCorners::rows.
  RegularCellWriter(std::span<const PlacedTriangles> triangles, const SignRow& row,
                    const std::array<const JoinedWords<kEdgePlaces>*, 4>& joined,
                    const EdgeOffsets& offsets)
      : triangles_{triangles.front().data(), triangles.back().data()},
        row_(row),
        joined_(joined),
        offsets_(offsets) {}

  // `places`: of the word's first sample.
  HWY_INLINE Triangle* write_word(std::size_t w, const RegularCells& cells,
                                  const std::uint32_t* places, Triangle* out) const {
    const std::array<BitWords, 2> kept = keep(w, cells.crossed);
    Word any = 0;
    for (const BitWords& words : kept) {
      for (const Word word : words) any |= word;
    }
    const std::array<BitBytes, 2> bytes = {transpose(kept[0]), transpose(kept[1])};
    // A flat list, because how many triangles a cell has is hard to predict.
    std::array<std::uint32_t, kWordBits * kMostTriangles + 8> list;
    std::uint32_t* next = list.data();
    for (Word rest = any; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      const std::uint32_t cell = bit << kCellShift | unsigned{cells.cases[bit]} << kCaseShift;
      next = list_members(cell, bytes[0][bit], next);
      next = list_members(cell + 8, bytes[1][bit], next);
    }
    const unsigned odd = row_.parity_at(0);
    for (const std::uint32_t* listed = list.data(); listed != next; ++listed) {
      const std::uint32_t x = *listed >> kCellShift;
      const std::uint32_t place = *listed & ((1U << kCellShift) - 1);
      const auto& names = triangles_[(x ^ odd) & 1][0].data()[place];
      const std::uint32_t* first = places + std::size_t{x} * kEdgePlaces;
      *out++ = {first[offsets_[names[0]]], first[offsets_[names[1]]], first[offsets_[names[2]]]};
    }
    return out;
  }

 private:
  static constexpr unsigned kCaseShift = 4;   // places of PlacedTriangles
  static constexpr unsigned kCellShift = 12;  // and cases

  // A word for each place of PlacedTriangles.
  HWY_INLINE std::array<BitWords, 2> keep(std::size_t w, Word cells) const {
    std::array<BitWords, 2> kept = {};
    if (!row_.is_five()) {
      keep_of<kSixTetrahedra>(w, cells, kept, std::make_index_sequence<6>());
    } else {
      keep_of<kFiveTetrahedraEven>(w, cells & row_.even(), kept, std::make_index_sequence<5>());
      keep_of<kFiveTetrahedraOdd>(w, cells & ~row_.even(), kept, std::make_index_sequence<5>());
    }
    return kept;
  }

  template <const auto& kTetrahedra, std::size_t... t>
  HWY_INLINE void keep_of(std::size_t w, Word cells, std::array<BitWords, 2>& kept,
                          std::index_sequence<t...> /*tetrahedra*/) const {
    const CornerWords signs = row_.corners(w);
    const JoinedCorners joined = {joined_, w};
    const auto keep_one = [&](std::size_t place, const std::array<Word, 2>& words) {
      for (std::size_t i = 0; i < 2; ++i) kept[place / 8][place % 8 + i] |= words[i] & cells;
    };
    (keep_one(2 * t, keep_triangles_of<kTetrahedra[t]>(signs, joined)), ...);
  }

  std::array<const std::array<std::array<EdgeName, 4>, kTrianglePlaces>*, 2> triangles_;
  const SignRow row_;
  const std::array<const JoinedWords<kEdgePlaces>*, 4> joined_;
  const EdgeOffsets& offsets_;
};

class RegularField : public ClusteredField<SignField> {
 public:
  using Row = RegularRow;
  using Cells = RegularCells;

  RegularField(const Extraction& extraction, std::uint32_t first)
      : ClusteredField(extraction, first), extraction_(extraction) {}

  RegularRow row(std::uint32_t y, std::uint32_t z) const {
    return {SignField::row(y, z), joined(y, z)};
  }

  RegularCellWriter cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                                Mesh& /*mesh*/) const {
    return {extraction_.placed, SignField::row(y, z), joined_around(y, z), offsets};
  }

 private:
  const Extraction& extraction_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
