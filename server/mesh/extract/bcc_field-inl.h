// What the walk reads of the body-centred lattice, plain and regularised. Compiled once for each
// instruction set, see slabs.cpp.
#if defined(ISOMESH_BCC_FIELD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_BCC_FIELD_INL_H_
#undef ISOMESH_BCC_FIELD_INL_H_
#else
#define ISOMESH_BCC_FIELD_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/bcc_signs-inl.h"
#include "server/mesh/extract/joined_edges-inl.h"
#include "server/mesh/extract/kept_triangles-inl.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/extract/regular-inl.h"
#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slabs.h"
#include "server/mesh/lattice/bcc_faces.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The crossings around 64 faces between cells that are joined; see JoinedCorners. The corners are
// the points of a face's cases.
template <unsigned kAxis>
struct JoinedFacePoints {
  template <unsigned kAt, unsigned kTo>
  HWY_INLINE Word at() const {
    constexpr BccEdge kEdge = bcc_face_edges(kAxis, BccSide::kInner)[bcc_edge_between(kAt, kTo)];
    constexpr unsigned kOwner = bcc_corner_of(kEdge.record, kAxis, BccSide::kInner);
    // Edges lead from centres to corners, and from the lower of two centres or corners.
    constexpr std::array kRanks = {0U, 1U, 2U, 3U, 4U, 3U};
    constexpr std::size_t kSlot = kEdge.slot;
    constexpr bool kIsFirst = kRanks[kAt] < kRanks[kTo];
    const JoinedWords<kBccDiagonalSlot>* words = rows[kOwner >> 1] + w;
    const auto bits_of = [](const JoinedWords<kBccDiagonalSlot>& edges) {
      return kIsFirst ? edges.first[kSlot] : edges.second[kSlot];
    };
    const Word bits = bits_of(words[0]);
    return (kOwner & 1) == 0 ? bits : bits >> 1 | bits_of(words[1]) << 63;
  }

  const std::array<const JoinedWords<kBccDiagonalSlot>*, 4>& rows;
  std::size_t w;
};

// Writes the triangles of the cells of one row; if there are clusters, those that are left.
template <bool kHasClusters>
class BccCellWriter {
 public:
  using JoinedAround = std::array<const JoinedWords<kBccDiagonalSlot>*, 4>;

  // `joined`: as JoinedCorners::rows.
  BccCellWriter(const Extraction& extraction, const BccRow& row, const JoinedAround& joined,
                const EdgeOffsets& offsets)
      : faces_(bcc_faces(extraction.to_space.determinant() < 0)),
        six_(extraction.splits[0]),
        row_(row),
        joined_(joined) {
    for (unsigned corner = 0; corner < 8; ++corner) {
      records_[corner] = offsets[edge_name(corner, 0)];
    }
  }

  // `places`: of the word's first record.
  HWY_INLINE Triangle* write_word(std::size_t w, const BccCells& /*cells*/,
                                  const std::uint32_t* places, Triangle* out) const {
    const CornerWords corners = row_.corners(w);
    out = write_faces<0>(w, corners, places, out);
    out = write_faces<1>(w, corners, places, out);
    out = write_faces<2>(w, corners, places, out);
    const Word cells = row_.split_in_six(w);
    return cells == 0 ? out : write_six(cells, corners, places, out);
  }

 private:
  static constexpr unsigned kCaseShift = 3;  // places of a BccFace
  static constexpr unsigned kFaceShift = 9;  // and cases

  template <unsigned kAxis>
  Triangle* write_faces(std::size_t w, const CornerWords& corners, const std::uint32_t* places,
                        Triangle* out) const {
    out = write_side<kAxis, BccSide::kInner>(w, corners, places, out);
    out = write_side<kAxis, BccSide::kLow>(w, corners, places, out);
    return write_side<kAxis, BccSide::kHigh>(w, corners, places, out);
  }

  template <unsigned kAxis, BccSide kSide>
  HWY_INLINE Triangle* write_side(std::size_t w, const CornerWords& corners,
                                  const std::uint32_t* places, Triangle* out) const {
    const BccFaceWords words = row_.faces(w, kAxis, kSide, corners);
    if (words.faces == 0) return out;
    const BccFace& face = faces_[kAxis][static_cast<std::size_t>(kSide)];
    const BitBytes cases = transpose(words.points);
    // A flat list, because how many triangles a face has is hard to predict.
    std::array<std::uint32_t, std::size_t{kWordBits} * 8 + 8> list;
    std::uint32_t* next = list.data();
    const auto list_faces = [&](Word faces, auto triangles_of) {
      for (Word rest = faces; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const std::uint32_t first = bit << kFaceShift | unsigned{cases[bit]} << kCaseShift;
        next = list_members(first, triangles_of(bit), next);
      }
    };
    // No cluster has an edge in the border.
    if constexpr (kHasClusters && kSide == BccSide::kInner) {
      const BitWords kept =
          keep(words, JoinedFacePoints<kAxis>{joined_, w}, std::make_index_sequence<4>());
      Word any = 0;
      for (const Word word : kept) any |= word;
      const BitBytes bytes = transpose(kept);
      list_faces(any, [&](unsigned bit) { return bytes[bit]; });
    } else {
      list_faces(words.faces, [&](unsigned bit) { return face.present[cases[bit]]; });
    }
    constexpr auto kEdges = bcc_face_edges(kAxis, kSide);
    std::array<std::ptrdiff_t, kBccFaceEdges> offsets;
    for (std::size_t e = 0; e < kBccFaceEdges; ++e) {
      offsets[e] = records_[bcc_corner_of(kEdges[e].record, kAxis, kSide)] + kEdges[e].slot;
    }
    const auto* triangles = face.triangles.front().data();
    for (const std::uint32_t* listed = list.data(); listed != next; ++listed) {
      const auto& names = triangles[*listed & ((1U << kFaceShift) - 1)];
      const std::uint32_t* first = places + std::size_t{*listed >> kFaceShift} * kBccPlaces;
      *out++ = {first[offsets[names[0]]], first[offsets[names[1]]], first[offsets[names[2]]]};
    }
    return out;
  }

  template <class Joins, std::size_t... t>
  HWY_INLINE static BitWords keep(const BccFaceWords& words, const Joins& joined,
                                  std::index_sequence<t...> /*tetrahedra*/) {
    BitWords kept;
    const auto keep_one = [&](std::size_t place, const std::array<Word, 2>& triangles) {
      kept[place] = triangles[0] & words.faces;
      kept[place + 1] = triangles[1] & words.faces;
    };
    (keep_one(2 * t, keep_triangles_of<kBccInnerTetrahedra[t]>(words.points, joined)), ...);
    return kept;
  }

  // The cells around the volume, which have no centres, and of whose edges no cluster has any.
  Triangle* write_six(Word cells, const CornerWords& corners, const std::uint32_t* places,
                      Triangle* out) const {
    const BitBytes cases = transpose(corners);
    for (Word rest = cells; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      const CellCase& cell = six_.cases[cases[bit]];
      const std::uint32_t* const first = places + bit * std::size_t{kBccPlaces};
      const auto at = [&](EdgeName name) {
        return first[records_[name / 8U] + static_cast<std::ptrdiff_t>(bcc_slot_of(name % 8U))];
      };
      for (std::size_t t = 0; t < cell.triangles; ++t) {
        const auto& [a, b, c] = cell.edges[t];
        *out++ = {at(a), at(b), at(c)};
      }
    }
    return out;
  }

  const BccFaces& faces_;
  const CellSplit& six_;
  const BccRow row_;
  const JoinedAround joined_;
  std::array<std::ptrdiff_t, 8> records_;  // of the corners of a cell, from corner 0's
};

// The signs of the planes around the one that is worked on, each found once as z rises.
class BccField {
 public:
  using Marched = Extraction;
  using Output = Mesh;
  using Cells = BccCells;
  using Row = BccRow;
  static constexpr std::size_t kPlaces = kBccPlaces;
  static constexpr bool kHasLines = false;
  static constexpr bool kHasClusters = false;
  // As in SignField. Samples and centres have clusters, and edges in the border are in none.
  static constexpr std::size_t kKinds = 2;
  static constexpr std::size_t kJoinedPlaces = kBccDiagonalSlot;
  static constexpr std::uint32_t kClusterPlaces = kBccPlaces;
  using Ends = BccEdgeSamples;

  BccField(const Extraction& extraction, std::uint32_t first)
      : extraction_(extraction),
        shape_(extraction),
        words_(words_of(extraction.dims.x)),
        uncertain_(words_),
        next_samples_(first),
        next_centres_(first) {
    for (std::size_t n = 0; n < kSamplePlanes; ++n) samples_.emplace_back(extraction.dims);
    for (std::size_t n = 0; n < kCentrePlanes; ++n) centres_.emplace_back(extraction.dims);
    for (unsigned slot = 0; slot < kBccSlots; ++slot) ends_[slot] = ends_of(slot);
  }

  // Finds what rows of plane z need. Afterwards rows of z - 1 and z can be asked for.
  void reach(std::uint32_t z) {
    const std::uint32_t end = extraction_.dims.z;
    for (; next_samples_ <= z + 2 && next_samples_ < end; ++next_samples_) {
      classify(extraction_, next_samples_, samples_[next_samples_ % kSamplePlanes]);
    }
    for (; next_centres_ <= z + 1 && next_centres_ + 1 < end; ++next_centres_) {
      if (shape_.has_plane(next_centres_)) find_centres(next_centres_);
    }
  }

  BccRow row(std::uint32_t y, std::uint32_t z) const {
    const std::uint32_t above = std::min(z + 1, extraction_.dims.z - 1);
    const SignPlane& here = centres_[z % kCentrePlanes];
    const SignPlane& next = centres_[(z + 1) % kCentrePlanes];
    const std::uint32_t behind = std::min(y + 1, extraction_.dims.y - 1);
    return {extraction_,
            shape_,
            samples_[z % kSamplePlanes],
            samples_[above % kSamplePlanes],
            {here.row(y), here.row(behind), next.row(y)},
            y,
            z};
  }

  // The signs of a row of points of plane z - 1 or z.
  const Word* signs(BccPoint point, std::uint32_t y, std::uint32_t z) const {
    return point == BccPoint::kSample ? samples_[z % kSamplePlanes].row(y)
                                      : centres_[z % kCentrePlanes].row(y);
  }

  static Mesh& mesh_of(Mesh& mesh) { return mesh; }

  EdgeFrame frame(unsigned /*parity*/, std::size_t slot) const {
    if (slot >= kBccSlots) return {};
    const LatticeToSpace& map = extraction_.to_space;
    const Double4 centre = space_offset(map, 7) * 0.5;
    if (slot < kBccAxisSlot) {
      return {centre, space_offset(map, static_cast<unsigned>(slot)) - centre};
    }
    return {is_from_centre(slot) ? centre : Double4{}, space_offset(map, end_of(slot))};
  }

  // The share of the way along its edge of each vertex of a row between the lattice's own samples.
  auto shares(std::uint32_t y, std::uint32_t z, std::span<const std::uint32_t> vertices) {
    if (shares_.size() < vertices.size()) shares_.resize(2 * vertices.size());
    cluster_shares(y, z, ends_.data(), vertices, shares_.data());
    return [shares = shares_.data()](std::size_t i) { return shares[i]; };
  }

  static LinksOfKinds<2> links(const Extraction& /*extraction*/) {
    return {&links_of(BccPoint::kSample), &links_of(BccPoint::kCentre)};
  }

  ClusterEdge<Ends> cluster_edge(unsigned parity, const LinkDirection& direction) const {
    ClusterEdge<Ends> edge = {ends_[direction.place], frame(parity, direction.place)};
    const std::ptrdiff_t to_owner = sample_offset(extraction_.inner, direction.corner);
    edge.ends.from -= to_owner;
    edge.ends.to -= to_owner;
    edge.frame.start -= space_offset(extraction_.to_space, direction.corner);
    return edge;
  }

  void cluster_shares(std::uint32_t y, std::uint32_t z, const Ends* ends,
                      std::span<const std::uint32_t> edges, double* out) const {
    const std::uint32_t margin = extraction_.margin;
    extraction_.samples->bcc_shares({y - margin, z - margin, margin, ends, edges}, out);
  }

  // Edges of centres are no edges of the border, though they may begin there.
  BorderVertex place_at_border(std::uint32_t x, std::uint32_t y, std::uint32_t z, std::size_t slot,
                               const EdgeFrame& frame) const {
    const BorderSample cell = {std::int64_t{x} - 1, std::int64_t{y} - 1, std::int64_t{z} - 1};
    if (!is_from_centre(slot) || (slot == 0 && !shape_.has_cell(x, y, z))) {
      const auto to = static_cast<std::uint8_t>(bcc_direction_of(static_cast<unsigned>(slot)));
      return extraction_.samples->place_at_border(cell, {0, to});
    }
    const auto place = static_cast<std::uint32_t>(x * kPlaces + slot);
    double share = 0;
    cluster_shares(y, z, ends_.data(), {&place, 1}, &share);
    // In the order of the walk's place_inner for the same bits.
    const LatticeToSpace& map = extraction_.to_space;
    const Double4 at = row_origin(map, static_cast<double>(cell[1]), static_cast<double>(cell[2])) +
                       lanes(map.step_x) * static_cast<double>(cell[0]);
    const Double4 exact = at + frame.start + frame.run * share;
    BorderVertex vertex;
    for (std::size_t i = 0; i < 3; ++i) vertex.position[i] = static_cast<float>(exact[i]);
    return vertex;
  }

  BccCellWriter<false> cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                                   Mesh& /*mesh*/) const {
    return {extraction_, row(y, z), {}, offsets};
  }

 private:
  static constexpr std::uint32_t kSamplePlanes = 4;
  static constexpr std::uint32_t kCentrePlanes = 3;

  static bool is_from_centre(std::size_t slot) {
    return slot < kBccAxisSlot || (slot >= kBccCentreSlot && slot < kBccDiagonalSlot);
  }

  // The sample, or the cell of the centre, at the end of a slot's edge: a corner of the record's.
  static unsigned end_of(std::size_t slot) {
    const auto number = static_cast<unsigned>(slot);
    if (slot < kBccAxisSlot) return number;
    return is_from_centre(slot) ? 1U << (number - kBccCentreSlot) : bcc_direction_of(number);
  }

  BccEdgeSamples ends_of(std::size_t slot) const {
    return {0, sample_offset(extraction_.inner, end_of(slot)), is_from_centre(slot),
            is_from_centre(slot) && slot >= kBccCentreSlot};
  }

  // Rounding is monotone, so the mean of samples on one side is on that side. Only the other means
  // are computed.
  void find_centres(std::uint32_t z) {
    const SignPlane& low = samples_[z % kSamplePlanes];
    const SignPlane& high = samples_[(z + 1) % kSamplePlanes];
    const std::uint32_t margin = extraction_.margin;
    for (std::uint32_t y = 0; y + 1 < extraction_.dims.y; ++y) {
      if (!shape_.has_row(y, z)) continue;
      const std::array rows = {low.row(y), low.row(y + 1), high.row(y), high.row(y + 1)};
      Word* out = centres_[z % kCentrePlanes].row(y);
      Word mixed = 0;
      for (std::size_t w = 0; w < words_; ++w) {
        Word any = 0;
        Word all = ~Word{0};
        for (const Word* row : rows) {
          const Word next = next_bits(row, w);
          any |= row[w] | next;
          all &= row[w] & next;
        }
        const Word cells = shape_.along_x(w).cells;
        out[w] = all & cells;
        uncertain_[w] = any & ~all & cells;
        mixed |= uncertain_[w];
      }
      if (mixed != 0)
        extraction_.samples->add_centres(y - margin, z - margin, margin, uncertain_, out);
    }
  }

  const Extraction& extraction_;
  const BccShape shape_;
  const std::size_t words_;
  std::vector<SignPlane> samples_;
  std::vector<SignPlane> centres_;
  std::vector<Word> uncertain_;
  std::array<BccEdgeSamples, kBccSlots> ends_;
  std::vector<double> shares_;
  std::uint32_t next_samples_;
  std::uint32_t next_centres_;
};

// A row without the vertices that clusters have instead of its edges.
class RegularBccRow : public BccRow {
 public:
  RegularBccRow(const BccRow& row, const JoinedWords<kBccDiagonalSlot>* joined)
      : BccRow(row), joined_(joined) {}

  Word describe(std::size_t w, BccCells& cells) const {
    auto lone = crossed_edges(w, corners(w));
    for (std::size_t slot = 0; slot < kBccDiagonalSlot; ++slot) {
      lone[slot] &= ~(joined_[w].first[slot] | joined_[w].second[slot]);
    }
    return cells.keep(lone);
  }

 private:
  const JoinedWords<kBccDiagonalSlot>* joined_;
};

class RegularBccField : public ClusteredField<BccField> {
 public:
  using Row = RegularBccRow;

  RegularBccField(const Extraction& extraction, std::uint32_t first)
      : ClusteredField(extraction, first), extraction_(extraction) {}

  RegularBccRow row(std::uint32_t y, std::uint32_t z) const {
    return {BccField::row(y, z), joined(y, z)};
  }

  BccCellWriter<true> cell_writer(std::uint32_t y, std::uint32_t z, const EdgeOffsets& offsets,
                                  Mesh& /*mesh*/) const {
    return {extraction_, BccField::row(y, z), joined_around(y, z), offsets};
  }

 private:
  const Extraction& extraction_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
