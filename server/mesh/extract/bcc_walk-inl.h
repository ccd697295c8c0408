// The walk over a slab of the body-centred lattice that counts, numbers and writes. Compiled once
// for each instruction set, see slabs.cpp.
#if defined(ISOMESH_BCC_WALK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_BCC_WALK_INL_H_
#undef ISOMESH_BCC_WALK_INL_H_
#else
#define ISOMESH_BCC_WALK_INL_H_
#endif

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/bcc_signs-inl.h"
#include "server/mesh/extract/slab_walk-inl.h"
#include "server/mesh/extract/slabs.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The edges of the slots, from the sample that names them.
inline std::array<EdgeFrame, kBccSlots> bcc_frames(const LatticeToSpace& map) {
  std::array<EdgeFrame, kBccSlots> frames = {};
  const Double4 centre = space_offset(map, 7) * 0.5;
  for (unsigned corner = 0; corner < 8; ++corner) {
    frames[corner] = {centre, space_offset(map, corner) - centre};
  }
  for (unsigned axis = 0; axis < 3; ++axis) {
    frames[kBccAxisSlot + axis] = {Double4{}, space_offset(map, 1U << axis)};
    frames[kBccCentreSlot + axis] = {centre, space_offset(map, 1U << axis)};
    frames[kBccDiagonalSlot + axis] = {Double4{}, space_offset(map, 7U ^ 1U << axis)};
  }
  return frames;
}

// A sample's record in a numbered row: the index of the first vertex that the sample owns, and the
// rank of each slot among them. Valid where the sample owns a vertex.
struct BccRanks {
  static constexpr std::size_t kPlaces = kBccPlaces;

  HWY_INLINE static void write(std::uint32_t* numbers, unsigned slots, std::uint32_t first) {
    const unsigned low = slots & 0xFF;
    const unsigned high = slots >> 8 & 0xFF;
    const auto before = static_cast<unsigned>(std::popcount(low));
    const std::uint64_t high_ranks = kRanks[high] + before * kOnes;
    numbers[0] = first;
    std::memcpy(numbers + 1, &kRanks[low], sizeof high_ranks);
    std::memcpy(numbers + 3, &high_ranks, sizeof high_ranks);
    numbers[5] = before + static_cast<unsigned>(std::popcount(high));
  }
  HWY_INLINE static std::uint32_t index(const std::uint32_t* numbers, unsigned slot) {
    return numbers[0] + reinterpret_cast<const std::uint8_t*>(numbers + 1)[slot];
  }

 private:
  static_assert(std::endian::native == std::endian::little);
  static constexpr std::uint64_t kOnes = 0x0101010101010101;
  // For each set of slots how many there are before each, a byte for each.
  static constexpr auto kRanks = [] {
    std::array<std::uint64_t, 256> ranks = {};
    for (unsigned set = 0; set < 256; ++set) {
      for (unsigned slot = 0; slot < 8; ++slot) {
        const auto before = static_cast<unsigned>(std::popcount(set & ((1U << slot) - 1)));
        ranks[set] |= std::uint64_t{before} << (8 * slot);
      }
    }
    return ranks;
  }();
};

// The surface as it is cut.
class BccPlain {
 public:
  using Numbers = BccRanks;
  static constexpr bool kHasClusters = false;

  BccPlain(const Extraction& /*extraction*/, std::uint32_t /*first*/) {}
};

// `Joined`: BccPlain, or BccRegular.
template <class Joined>
class BccWriter {
 public:
  using Numbers = typename Joined::Numbers;

  BccWriter(const Extraction& extraction, const Slab& slab, IndexMemory& memory, Mesh& mesh)
      : extraction_(extraction),
        dims_(extraction.dims),
        slab_(slab),
        mesh_(mesh),
        faces_(bcc_faces(extraction.to_space.determinant() < 0)),
        field_(extraction, slab.begin),
        joined_(extraction, slab.begin),
        rows_(extraction.dims, memory),
        words_(words_of(extraction.dims.x)),
        // Places are written eight at a time, so there is room for one more sample.
        vertices_((std::size_t{extraction.dims.x} + 1) * kBccSlots),
        frames_(bcc_frames(extraction.to_space)),
        end_(mesh.triangles.data() + mesh.layer_triangles[slab.end]) {}

  // The order of SlabWriter::write.
  void write() {
    auto vertex = static_cast<std::uint32_t>(mesh_.layer_vertices[slab_.begin]);
    field_.reach(slab_.begin);
    for (std::uint32_t y = 0; y < dims_.y; ++y) number_row(y, slab_.begin, vertex);
    Triangle* out = mesh_.triangles.data() + mesh_.layer_triangles[slab_.begin];
    for (std::uint32_t z = slab_.begin; z < slab_.end && z + 1 < dims_.z; ++z) {
      field_.reach(z + 1);
      number_row(0, z + 1, vertex);
      for (std::uint32_t y = 0; y + 1 < dims_.y; ++y) {
        number_row(y + 1, z + 1, vertex);
        out = write_triangles(y, z, out);
      }
    }
  }

 private:
  void number_row(std::uint32_t y, std::uint32_t z, std::uint32_t& vertex) {
    if constexpr (Joined::kHasClusters) {
      const std::array rows = {rows_.indices(y, z), rows_.indices(y - 1, z),
                               rows_.indices(y, z - 1), rows_.indices(y - 1, z - 1)};
      vertex = joined_.number_clusters(y, z, rows, vertex, z < slab_.end ? &mesh_ : nullptr);
    }
    find_vertices(y, z, vertex);
    if (z < slab_.end) place_vertices(y, z, vertex);
    vertex += static_cast<std::uint32_t>(found_);
  }

  // Numbers the vertices that the row's samples own from `vertex` on, and lists them in order.
  void find_vertices(std::uint32_t y, std::uint32_t z, std::uint32_t vertex) {
    const BccRow row = field_.row(y, z);
    std::uint32_t* numbers = rows_.indices(y, z);
    std::uint32_t* const list = vertices_.data();
    std::uint32_t* next = list;
    for (std::size_t w = 0; w < words_; ++w) {
      if (!row.may_cross(w)) continue;
      const auto crossed = row.crossed_edges(w, row.corners(w));
      const BccSlots slots(crossed);
      for (Word rest = slots.owners(); rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const std::size_t x = w * kWordBits + bit;
        unsigned owned = slots.of(bit);
        if constexpr (Joined::kHasClusters) owned &= ~joined_.row(y, z)[x];
        Numbers::write(numbers + x * Numbers::kPlaces, owned,
                       vertex + static_cast<std::uint32_t>(next - list));
        next = list_slots(x, owned, next);
      }
    }
    found_ = static_cast<std::size_t>(next - list);
  }

  // The crossed edges of 64 samples, turned so that each sample's are together.
  class BccSlots {
   public:
    explicit BccSlots(const std::array<Word, kBccSlots>& crossed) : last_(crossed[16]) {
      CornerWords words;
      for (std::size_t half = 0; half < 2; ++half) {
        std::copy_n(crossed.begin() + half * 8, 8, words.begin());
        for (const Word word : words) owners_ |= word;
        bytes_[half] = transpose(words);
      }
      owners_ |= last_;
    }
    Word owners() const { return owners_; }
    unsigned of(unsigned bit) const {
      return bytes_[0][bit] | unsigned{bytes_[1][bit]} << 8 |
             static_cast<unsigned>(last_ >> bit & 1) << 16;
    }

   private:
    std::array<std::array<std::uint8_t, kWordBits>, 2> bytes_;
    Word last_;
    Word owners_ = 0;
  };

  // Whole groups of eight are written; only what is before the returned place is valid.
  HWY_INLINE static std::uint32_t* list_slots(std::size_t x, unsigned slots, std::uint32_t* next) {
    const auto base = static_cast<std::uint32_t>(x * kBccSlotRange);
    next = list_members(base, slots & 0xFF, next);
    next = list_members(base + 8, slots >> 8 & 0xFF, next);
    if ((slots >> 16) != 0) *next++ = base + 16;
    return next;
  }

  // Places the vertices of the row, the first of which is `vertex`.
  void place_vertices(std::uint32_t y, std::uint32_t z, std::uint32_t vertex) {
    if (extraction_.margin == 0) return place_inner(0, found_, y, z, vertex);
    const bool row_is = is_at_border(y, dims_.y) || is_at_border(z, dims_.z);
    std::size_t begin = 0;  // of a run that is not at the border
    for (std::size_t i = 0; i < found_; ++i) {
      const std::uint32_t x = vertices_[i] / kBccSlotRange;
      const unsigned slot = vertices_[i] % kBccSlotRange;
      if (!(row_is || is_at_border(x, dims_.x)) || !joins_samples(x, y, z, slot)) continue;
      place_inner(begin, i, y, z, vertex);
      place_at_border(x, y, z, slot, vertex + i);
      begin = i + 1;
    }
    place_inner(begin, found_, y, z, vertex);
  }

  bool joins_samples(std::uint32_t x, std::uint32_t y, std::uint32_t z, unsigned slot) const {
    if (slot == 0) return !field_.shape().has_cell(x, y, z);
    return slot >= kBccAxisSlot && (slot < kBccCentreSlot || slot >= kBccDiagonalSlot);
  }

  void place_at_border(std::uint32_t x, std::uint32_t y, std::uint32_t z, unsigned slot,
                       std::size_t vertex) const {
    const BorderSample cell = {std::int64_t{x} - 1, std::int64_t{y} - 1, std::int64_t{z} - 1};
    const auto to = static_cast<std::uint8_t>(bcc_direction_of(slot));
    const BorderVertex placed = extraction_.samples->place_at_border(cell, {0, to});
    mesh_.positions[vertex] = placed.position;
    if (placed.on_border) set_flag(mesh_.on_border, vertex);
  }

  // Those of the vertices [begin, end), between samples and centres of the lattice itself.
  void place_inner(std::size_t begin, std::size_t end, std::uint32_t y, std::uint32_t z,
                   std::uint32_t vertex) {
    if (begin == end) return;
    const LatticeToSpace& map = extraction_.to_space;
    const std::uint32_t margin = extraction_.margin;
    if (shares_.size() < end - begin) shares_.resize(2 * (end - begin));
    extraction_.samples->bcc_shares(
        {y - margin, z - margin, margin, std::span(vertices_).subspan(begin, end - begin)},
        shares_.data());
    const Double4 row_at = row_origin(map, y - margin, z - margin);
    const Double4 step_x = lanes(map.step_x);
    Vec3* out = mesh_.positions.data() + vertex;
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t x = vertices_[i] / kBccSlotRange;
      const EdgeFrame& edge = frames_[vertices_[i] % kBccSlotRange];
      const Double4 at =
          row_at + step_x * static_cast<double>(static_cast<std::int32_t>(x - margin));
      const Float4 position =
          __builtin_convertvector(at + edge.start + edge.run * shares_[i - begin], Float4);
      std::memcpy(out + i, &position, sizeof *out);
    }
  }

  Triangle* write_triangles(std::uint32_t y, std::uint32_t z, Triangle* out) {
    const BccRow row = field_.row(y, z);
    for (unsigned r = 0; r < 4; ++r) around_[r] = rows_.indices(y + (r & 1), z + (r >> 1));
    for (std::size_t w = 0; w < words_; ++w) {
      if (!row.may_cross(w)) continue;
      const CornerWords corners = row.corners(w);
      out = write_faces<0>(row, w, corners, out);
      out = write_faces<1>(row, w, corners, out);
      out = write_faces<2>(row, w, corners, out);
      if (const Word cells = row.split_in_six(w); cells != 0) {
        out = write_six(w, cells, corners, out);
      }
    }
    return out;
  }

  // The numbers of the sample at a corner of the cell at x.
  const std::uint32_t* numbers_at(std::size_t x, unsigned corner) const {
    return around_[corner >> 1] + (x + (corner & 1)) * Numbers::kPlaces;
  }

  template <unsigned kAxis>
  Triangle* write_faces(const BccRow& row, std::size_t w, const CornerWords& corners,
                        Triangle* out) const {
    out = write_side<kAxis, BccSide::kInner>(row, w, corners, out);
    out = write_side<kAxis, BccSide::kLow>(row, w, corners, out);
    return write_side<kAxis, BccSide::kHigh>(row, w, corners, out);
  }

  template <unsigned kAxis, BccSide kSide>
  HWY_INLINE Triangle* write_side(const BccRow& row, std::size_t w, const CornerWords& corners,
                                  Triangle* out) const {
    const BccFaceWords words = row.faces(w, kAxis, kSide, corners);
    if (words.faces == 0) return out;
    const BccFace& face = faces_[kAxis][static_cast<std::size_t>(kSide)];
    constexpr unsigned kPlane = kSide == BccSide::kLow ? 0 : 1U << kAxis;
    constexpr std::array kRecords = {0U, kPlane, kPlane | 1U << (kAxis + 1) % 3,
                                     kPlane | 1U << (kAxis + 2) % 3};
    constexpr auto kEdges = bcc_face_edges(kAxis, kSide);
    const auto cases = transpose(words.points);
    for (Word rest = words.faces; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      const std::size_t x = w * kWordBits + bit;
      // All of them, because which are crossed is hard to foresee; others have no meaning.
      std::array<std::uint32_t, kBccFaceEdges> indices;
      for (std::size_t e = 0; e < kBccFaceEdges; ++e) {
        const unsigned record = kRecords[static_cast<std::size_t>(kEdges[e].record)];
        indices[e] = Numbers::index(numbers_at(x, record), kEdges[e].slot);
      }
      out = write_face(face.cases[cases[bit]], indices, out);
    }
    return out;
  }

  // Leaves out triangles of which two corners are one vertex.
  HWY_INLINE Triangle* write_face(const BccFaceCase& found,
                                  const std::array<std::uint32_t, kBccFaceEdges>& indices,
                                  Triangle* out) const {
    const auto write = [&](std::size_t t, Triangle* to) {
      const auto& [a, b, c] = found.triangles[t];
      return write_triangle({indices[a], indices[b], indices[c]}, to);
    };
    if (Joined::kHasClusters || end_ - out < std::ssize(found.triangles)) {
      for (std::size_t t = 0; t < found.triangle_count; ++t) out = write(t, out);
      return out;
    }
    // Fixed numbers of them, because how many there are is hard to foresee, too.
    constexpr std::size_t kOften = 4;
    for (std::size_t t = 0; t < kOften; ++t) write(t, out + t);
    if (found.triangle_count > kOften) {
      for (std::size_t t = kOften; t < found.triangles.size(); ++t) write(t, out + t);
    }
    return out + found.triangle_count;
  }

  HWY_INLINE static Triangle* write_triangle(const Triangle& triangle, Triangle* out) {
    if constexpr (Joined::kHasClusters) {
      const auto& [a, b, c] = triangle;
      if (a == b || b == c || c == a) return out;
    }
    *out++ = triangle;
    return out;
  }

  // The cells around the volume, which have no centres.
  Triangle* write_six(std::size_t w, Word cells, const CornerWords& corners, Triangle* out) const {
    for (Word rest = cells; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(rest));
      const std::size_t x = w * kWordBits + bit;
      unsigned inside = 0;
      for (unsigned c = 0; c < 8; ++c) inside |= static_cast<unsigned>(corners[c] >> bit & 1) << c;
      const CellCase& cell = extraction_.splits[0].cases[inside];
      const auto index = [&](EdgeName name) {
        return Numbers::index(numbers_at(x, name / 8U), bcc_slot_of(name % 8U));
      };
      for (std::size_t t = 0; t < cell.triangles; ++t) {
        const auto& [a, b, c] = cell.edges[t];
        out = write_triangle({index(a), index(b), index(c)}, out);
      }
    }
    return out;
  }

  const Extraction& extraction_;
  const Dims dims_;
  const Slab slab_;
  Mesh& mesh_;
  const BccFaces& faces_;
  BccField field_;
  Joined joined_;
  IndexRing<Numbers::kPlaces> rows_;
  const std::size_t words_;
  std::vector<std::uint32_t> vertices_;  // of the row that is numbered: kBccSlotRange x + slot
  std::size_t found_ = 0;
  std::vector<double> shares_;
  const std::array<EdgeFrame, kBccSlots> frames_;
  const Triangle* const end_;                        // of the slab's triangles
  std::array<const std::uint32_t*, 4> around_ = {};  // the rows of the cells that are written
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
