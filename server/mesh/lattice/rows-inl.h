// Rows of samples and cells, 64 at a time: shared by the walks over an iso-value's signs and over
// labels. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_ROWS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_ROWS_INL_H_
#undef ISOMESH_ROWS_INL_H_
#else
#define ISOMESH_ROWS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/tetrahedra.h"
#include "server/mesh/lattice/transpose-inl.h"
#include "server/mesh/mesh.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

inline constexpr Word kEvenX = 0x5555555555555555;

// The number of words of a row of this many samples.
inline std::size_t words_of(std::uint32_t samples) {
  return (std::size_t{samples} + kWordBits - 1) / kWordBits;
}

// Eight bytes of 0 or 1 to the eight bits of a byte, the first byte the lowest bit.
inline std::uint8_t pack_byte(const std::uint8_t* flags) {
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, flags, sizeof bytes);
  return static_cast<std::uint8_t>(bytes * 0x0102040810204080 >> 56);
}

// 64 bytes of 0 or 1 to the bits of a word.
HWY_INLINE Word pack_word(const std::array<std::uint8_t, kWordBits>& flags) {
  Word word = 0;
  for (unsigned byte = 0; byte < 8; ++byte) {
    word |= Word{pack_byte(flags.data() + byte * std::size_t{8})} << (byte * 8);
  }
  return word;
}

// One bit for each of the eight corners of 64 cells of a row: word c holds corner c of each.
using CornerWords = BitWords;

// The members of each set of directions, in order.
inline constexpr auto kMembers = [] {
  std::array<std::array<std::uint8_t, 8>, 256> members = {};
  for (unsigned set = 0; set < 256; ++set) {
    std::size_t found = 0;
    for (unsigned direction = 0; direction < 8; ++direction) {
      if ((set >> direction & 1) != 0) {
        members[set][found++] = static_cast<std::uint8_t>(direction);
      }
    }
  }
  return members;
}();

// Lists `base` plus each of the members of a set, in order. Eight places of the list are written,
// and only those before what is returned are valid.
HWY_INLINE std::uint32_t* list_members(std::uint32_t base, unsigned set, std::uint32_t* next) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::CappedTag<std::uint32_t, 8> wide;
  const hn::Rebind<std::uint8_t, decltype(wide)> narrow;
  for (std::size_t i = 0; i < kMembers[set].size(); i += hn::Lanes(wide)) {
    const auto members = hn::PromoteTo(wide, hn::LoadU(narrow, kMembers[set].data() + i));
    hn::StoreU(hn::Add(hn::Set(wide, base), members), wide, next + i);
  }
  return next + std::popcount(set);
}

// The number of vertices that a word's samples own, and of triangles of its cells.
struct WordCount {
  unsigned vertices = 0;
  unsigned triangles = 0;
};

template <std::size_t kWords>
HWY_INLINE unsigned count_bits(const std::array<Word, kWords>& words) {
  unsigned count = 0;
  for (const Word word : words) count += static_cast<unsigned>(std::popcount(word));
  return count;
}

// The edges that the samples of a row own, and its cells. Beyond the upper borders of the lattice
// the last rows stand for those that are missing, and everything that depends on them is masked.
class RowShape {
 public:
  // `even` are the samples of even parity in a word of the row.
  RowShape(const Dims& dims, Scheme scheme, Word even, std::uint32_t y, std::uint32_t z)
      : last_x_(dims.x - 1),
        has_y_(y + 1 < dims.y),
        has_z_(z + 1 < dims.z),
        five_(scheme == Scheme::kFive),
        even_(even),
        odd_((even & 1) != 0 ? 0 : 1) {}

  // The set (bit d: direction d) of edges that the row's samples own, except for the sample of the
  // largest x, which owns no edge with a part along x.
  unsigned existing() const {
    constexpr unsigned kAll = 0b11111110;
    constexpr unsigned kWithY = 0b11001100;
    constexpr unsigned kWithZ = 0b11110000;
    constexpr unsigned kFiveHasNone = 0b10000000;
    return kAll & ~(has_y_ ? 0 : kWithY) & ~(has_z_ ? 0 : kWithZ) & ~(five_ ? kFiveHasNone : 0);
  }

  // The same for the sample at x.
  unsigned existing_at(std::size_t x) const {
    constexpr unsigned kWithX = 0b10101010;
    return x == last_x_ ? existing() & ~kWithX : existing();
  }

  // The axes (bit 0: x) along which the sample at x has a next one.
  unsigned axes_at(std::size_t x) const {
    return (x == last_x_ ? 0U : 1U) | (has_y_ ? 2U : 0U) | (has_z_ ? 4U : 0U);
  }

  // 0 or 1: the parity of the sample or cell at x.
  unsigned parity_at(std::size_t x) const { return (x + odd_) & 1; }

  bool is_five() const { return five_; }
  Word even() const { return even_; }

 protected:
  std::uint32_t next_row(std::uint32_t y) const { return has_y_ ? y + 1 : y; }

  // The samples whose next neighbour along x exists.
  Word has_next(std::size_t w) const {
    const std::size_t begin = w * kWordBits;
    if (begin + kWordBits <= last_x_) return ~Word{0};
    return begin >= last_x_ ? 0 : (Word{1} << (last_x_ - begin)) - 1;
  }

  // The samples that exist, given has_next(w); beyond the last x there are none.
  Word samples(std::size_t w, Word next_x) const {
    return next_x << 1 | (w == 0 ? 1 : has_next(w - 1) >> 63);
  }

  Word cells(std::size_t w) const { return has_y_ && has_z_ ? has_next(w) : 0; }

  // The result of `compare(a, b)` for the corners at the first and the second end of the edges of a
  // direction, for each sample's own edge.
  template <class Compare>
  HWY_INLINE Word between_ends(unsigned direction, Compare compare) const {
    const Word edges = compare(0U, direction);
    if (!five_ || std::popcount(direction) != 2) return edges;
    // The diagonal of a face joins its two other corners when its sample is odd.
    const unsigned low = direction & (~direction + 1);
    return (edges & even_) | (compare(low, direction ^ low) & ~even_);
  }

  // Word d: the samples whose edge of direction d exists and is crossed; word 0 is zero. `differ(a,
  // b)` returns the cells whose corners a and b are on different sides.
  template <class Differ>
  HWY_INLINE std::array<Word, 8> edges_where(std::size_t w, Differ differ) const {
    const Word next_x = has_next(w);
    const Word here = samples(w, next_x);
    std::array<Word, 8> crossed = {};
    for (unsigned direction = 1; direction < 8; ++direction) {
      if ((existing() >> direction & 1) == 0) continue;
      crossed[direction] = between_ends(direction, differ) & ((direction & 1) != 0 ? next_x : here);
    }
    return crossed;
  }

 private:
  std::size_t last_x_;
  bool has_y_;
  bool has_z_;
  bool five_;
  Word even_;
  unsigned odd_;  // the parity of the first sample
};

// Four lanes, of which the last is idle: positions in double precision until they are stored.
using Double4 = double __attribute__((vector_size(32)));
using Float4 = float __attribute__((vector_size(16)));
// The same in objects that may be allocated: containers take the alignment of wide lanes for that
// of the oldest processors.
using StoredDouble4 = double __attribute__((vector_size(32), aligned(16)));

HWY_INLINE Double4 lanes(const std::array<double, 3>& offset) {
  return Double4{offset[0], offset[1], offset[2], 0};
}

// A corner of a cell as seen from corner 0, in millimetres.
HWY_INLINE Double4 space_offset(const LatticeToSpace& map, unsigned corner) {
  return lanes(map.step_x) * (corner & 1) + lanes(map.step_y) * (corner >> 1 & 1) +
         lanes(map.step_z) * (corner >> 2);
}

// The sample x = 0 of a row, in millimetres.
HWY_INLINE Double4 row_origin(const LatticeToSpace& map, double y, double z) {
  return lanes(map.origin) + lanes(map.step_y) * y + lanes(map.step_z) * z;
}

// The edge of a vertex: where it begins and its direction, in millimetres, relative to the sample
// that owns it. A vertex on no edge has a line of its own, and is half-way along it.
struct EdgeFrame {
  StoredDouble4 start = {};
  StoredDouble4 run = {};
};

// The place of each edge's vertex index, relative to corner 0's first one.
using EdgeOffsets = std::array<std::ptrdiff_t, 64>;

// Another task may set flags in the same word.
inline void set_flag(std::vector<std::uint64_t>& flags, std::size_t vertex) {
  std::atomic_ref(flags[vertex / kFlagBits])
      .fetch_or(Word{1} << (vertex % kFlagBits), std::memory_order_relaxed);
}

// Writes the triangles of one case of the tables. Returns the end of what was written.
HWY_INLINE Triangle* write_case(const CellCase& cell, const std::uint32_t* places,
                                const EdgeOffsets& offsets, Triangle* out) {
  for (std::size_t t = 0; t < cell.triangles; ++t) {
    const auto& [a, b, c] = cell.edges[t];
    *out++ = {places[offsets[a]], places[offsets[b]], places[offsets[c]]};
  }
  return out;
}

// Leaves out triangles with a repeated vertex. Writes nothing from `end` on.
HWY_INLINE Triangle* write_kept(const CellCase& cell, const std::uint32_t* places,
                                const EdgeOffsets& offsets, const Triangle* end, Triangle* out) {
  // Writes one triangle more than it keeps, instead of a branch that no processor could predict.
  const auto keep = [&](Triangle* to) {
    for (std::size_t t = 0; t < cell.triangles; ++t) {
      const auto& [first, second, third] = cell.edges[t];
      const std::uint32_t a = places[offsets[first]];
      const std::uint32_t b = places[offsets[second]];
      const std::uint32_t c = places[offsets[third]];
      *to = {a, b, c};
      to += static_cast<unsigned>(a != b) & static_cast<unsigned>(b != c) &
            static_cast<unsigned>(c != a);
    }
    return to;
  };
  if (end - out > static_cast<std::ptrdiff_t>(kMostTriangles)) return keep(out);
  std::array<Triangle, kMostTriangles + 1> all;
  const Triangle* last = keep(all.data());
  return std::copy(static_cast<const Triangle*>(all.data()), last, out);
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
