// Which samples are inside, one bit each, and the logic on 64 samples at a time that extraction
// counts and walks with. Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_SIGNS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_SIGNS_INL_H_
#undef ISOMESH_SIGNS_INL_H_
#else
#define ISOMESH_SIGNS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/slabs.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

using Word = std::uint64_t;  // 64 samples of a row, the lowest bit the smallest x
inline constexpr unsigned kWordBits = 64;
inline constexpr Word kEvenX = 0x5555555555555555;

// The signs of one plane of samples. Each row ends in one word of zeros, so that the word after a
// row's last one can be read.
class SignPlane {
 public:
  explicit SignPlane(const Dims& dims)
      : words_((dims.x + kWordBits - 1) / kWordBits), bits_((words_ + 1) * dims.y) {}

  std::size_t words() const { return words_; }
  Word* row(std::size_t y) { return bits_.data() + y * (words_ + 1); }
  const Word* row(std::size_t y) const { return bits_.data() + y * (words_ + 1); }

 private:
  std::size_t words_;
  std::vector<Word> bits_;
};

// Eight bytes of 0 or 1 to the eight bits of a byte, the first byte the lowest bit.
inline std::uint8_t pack_byte(const std::uint8_t* flags) {
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, flags, sizeof bytes);
  return static_cast<std::uint8_t>(bytes * 0x0102040810204080 >> 56);
}

// The signs of up to 64 samples; bits beyond `count` are zero.
template <class T>
HWY_INLINE Word classify_word(const T* samples, std::size_t count, T smallest) {
  std::array<std::uint8_t, kWordBits> flags = {};
  if (count == kWordBits) {  // a constant count, which the compiler turns into wide compares
    for (std::size_t x = 0; x < kWordBits; ++x) flags[x] = samples[x] >= smallest ? 1 : 0;
  } else {
    for (std::size_t x = 0; x < count; ++x) flags[x] = samples[x] >= smallest ? 1 : 0;
  }
  Word word = 0;
  for (unsigned byte = 0; byte < 8; ++byte) {
    word |= Word{pack_byte(flags.data() + byte * std::size_t{8})} << (byte * 8);
  }
  return word;
}

// Fills `plane` with the signs of the samples of plane z.
template <class T>
void classify(const Lattice<T>& lattice, std::uint32_t z, T smallest, SignPlane& plane) {
  const std::size_t width = lattice.dims.x;
  const T* samples = lattice.samples + std::size_t{z} * lattice.dims.y * width;
  for (std::uint32_t y = 0; y < lattice.dims.y; ++y, samples += width) {
    Word* row = plane.row(y);
    for (std::size_t w = 0; w < plane.words(); ++w) {
      const std::size_t begin = w * kWordBits;
      row[w] =
          classify_word(samples + begin, std::min<std::size_t>(kWordBits, width - begin), smallest);
    }
  }
}

// The same for the plane that is z when phantoms are numbered too: a phantom, which is outside, is
// on each of its sides, so that rows begin one bit later.
template <class T>
void classify_with_margin(const Lattice<T>& lattice, std::uint32_t z, T smallest,
                          SignPlane& plane) {
  const std::size_t width = lattice.dims.x;
  const std::size_t words = plane.words();
  std::fill_n(plane.row(0), words, 0);
  std::fill_n(plane.row(lattice.dims.y + 1), words, 0);
  const bool is_phantom = z == 0 || z == lattice.dims.z + 1;
  for (std::uint32_t y = 0; y < lattice.dims.y; ++y) {
    Word* row = plane.row(y + 1);
    if (is_phantom) {
      std::fill_n(row, words, 0);
      continue;
    }
    const T* samples = lattice.samples + (std::size_t{z - 1} * lattice.dims.y + y) * width;
    Word carry = 0;
    for (std::size_t w = 0; w < words; ++w) {
      const std::size_t begin = std::min(w * kWordBits, width);
      const Word signs =
          classify_word(samples + begin, std::min<std::size_t>(kWordBits, width - begin), smallest);
      row[w] = signs << 1 | carry;
      carry = signs >> (kWordBits - 1);
    }
  }
}

// The signs of the eight corners of 64 cells of a row: word c holds corner c of each.
using CornerWords = std::array<Word, 8>;

// Bit i of byte j of the result is bit j of word i, for the 64 bits of eight words.
inline std::array<std::uint8_t, kWordBits> transpose(const std::array<Word, 8>& words) {
  std::array<std::uint8_t, kWordBits> bytes;
  for (unsigned group = 0; group < 8; ++group) {
    Word square = 0;  // row r: byte `group` of word r
    for (unsigned r = 0; r < 8; ++r) square |= (words[r] >> (group * 8) & 0xFF) << (r * 8);
    // Swaps ever larger squares across the diagonal (H. S. Warren, Hacker's Delight, 7-3).
    Word swap = (square ^ square >> 7) & 0x00AA00AA00AA00AA;
    square ^= swap ^ swap << 7;
    swap = (square ^ square >> 14) & 0x0000CCCC0000CCCC;
    square ^= swap ^ swap << 14;
    swap = (square ^ square >> 28) & 0x00000000F0F0F0F0;
    square ^= swap ^ swap << 28;
    std::memcpy(bytes.data() + group * std::size_t{8}, &square, sizeof square);
  }
  return bytes;
}

inline unsigned count_in_tetrahedron(const CornerWords& corners,
                                     const std::array<std::uint8_t, 4>& tetrahedron, Word cells) {
  const Word a = corners[tetrahedron[0]];
  const Word b = corners[tetrahedron[1]];
  const Word c = corners[tetrahedron[2]];
  const Word d = corners[tetrahedron[3]];
  const Word odd = (a ^ b ^ c ^ d) & cells;                         // one or three inside
  const Word mixed = ((a | b | c | d) & ~(a & b & c & d)) & cells;  // one, two or three
  return static_cast<unsigned>(std::popcount(odd) + 2 * std::popcount(mixed & ~odd));
}

// One row of cells: the four rows of signs around it, and which of its cells and edges there are.
// Beyond the lattice's upper borders there are no rows; the last ones stand for them, and what
// depends on their signs is left out.
class CellRow {
 public:
  // `even` are the samples of even parity in a word of the row.
  CellRow(const Dims& dims, Scheme scheme, Word even, const SignPlane& low, const SignPlane& high,
          std::uint32_t y, std::uint32_t z)
      : last_x_(dims.x - 1),
        has_y_(y + 1 < dims.y),
        has_z_(z + 1 < dims.z),
        five_(scheme == Scheme::kFive),
        even_(even) {
    const std::uint32_t next = has_y_ ? y + 1 : y;
    rows_[0] = low.row(y);
    rows_[1] = low.row(next);
    rows_[2] = high.row(y);
    rows_[3] = high.row(next);
  }

  // Quick test on the signs alone: false when no sample of word w has a crossed edge.
  bool may_cross(std::size_t w) const {
    Word any = 0;
    Word all = ~Word{0};
    for (const Word* row : rows_) {
      any |= row[w] | row[w + 1] << 63;
      all &= row[w] & (row[w + 1] << 63 | ~Word{0} >> 1);
    }
    return any != 0 && all != ~Word{0};
  }

  CornerWords corners(std::size_t w) const {
    CornerWords corners;
    for (unsigned r = 0; r < 4; ++r) {
      corners[std::size_t{2} * r] = rows_[r][w];
      corners[std::size_t{2} * r + 1] = rows_[r][w] >> 1 | rows_[r][w + 1] << 63;
    }
    return corners;
  }

  // Word d: the samples whose edge of direction d exists and is crossed; word 0 is zero.
  std::array<Word, 8> crossed_edges(std::size_t w, const CornerWords& corners) const {
    const Word next_x = has_next(w);
    // Beyond the last x there are no samples at all.
    const Word here = next_x << 1 | (w == 0 ? 1 : has_next(w - 1) >> 63);
    std::array<Word, 8> crossed = {};
    for (unsigned direction = 1; direction < 8; ++direction) {
      if ((existing() >> direction & 1) == 0) continue;
      Word edges = corners[0] ^ corners[direction];
      if (five_ && std::popcount(direction) == 2) {
        // The diagonal of a face joins its two other corners when its sample is odd.
        const unsigned low = direction & (~direction + 1);
        edges = (edges & even_) | ((corners[low] ^ corners[direction ^ low]) & ~even_);
      }
      crossed[direction] = edges & ((direction & 1) != 0 ? next_x : here);
    }
    return crossed;
  }

  // The set (bit d: direction d) of edges that the row's samples own, but for the sample of the
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

  // The cells that exist and have corners on both sides.
  Word crossed_cells(std::size_t w, const CornerWords& corners) const {
    if (!has_y_ || !has_z_) return 0;
    Word any = 0;
    Word all = ~Word{0};
    for (const Word corner : corners) {
      any |= corner;
      all &= corner;
    }
    return any & ~all & has_next(w);
  }

  // How many triangles these 64 cells have; `splits` of cells of even and odd parity.
  unsigned count_triangles(std::size_t w, const CornerWords& corners,
                           const std::array<CellSplit, 2>& splits) const {
    const Word cells = crossed_cells(w, corners);
    if (cells == 0) return 0;
    unsigned count = 0;
    for (std::size_t t = 0; t < splits[0].tetrahedra; ++t) {
      count += count_in_tetrahedron(corners, splits[0].corners[t], five_ ? cells & even_ : cells);
      if (five_) count += count_in_tetrahedron(corners, splits[1].corners[t], cells & ~even_);
    }
    return count;
  }

 private:
  // The samples whose next neighbour along x exists.
  Word has_next(std::size_t w) const {
    const std::size_t begin = w * kWordBits;
    if (begin + kWordBits <= last_x_) return ~Word{0};
    return begin >= last_x_ ? 0 : (Word{1} << (last_x_ - begin)) - 1;
  }

  std::array<const Word*, 4> rows_;  // at (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)
  std::size_t last_x_;
  bool has_y_;
  bool has_z_;
  bool five_;
  Word even_;
};

// The signs of the planes around the one that is worked on, each classified once as z rises.
template <class T>
class SignWindow {
 public:
  SignWindow(const Extraction<T>& extraction, std::uint32_t first)
      : extraction_(extraction),
        dims_(extraction.dims),
        planes_{SignPlane(dims_), SignPlane(dims_), SignPlane(dims_)},
        next_(first) {}

  std::size_t words() const { return planes_[0].words(); }

  // Classifies up to the plane above z. Afterwards rows of z - 1 and z can be asked for.
  void reach(std::uint32_t z) {
    for (; next_ <= z + 1 && next_ < dims_.z; ++next_) {
      SignPlane& plane = planes_[next_ % kPlanes];
      if (extraction_.margin == 0) {
        classify(extraction_.lattice, next_, extraction_.smallest, plane);
      } else {
        classify_with_margin(extraction_.lattice, next_, extraction_.smallest, plane);
      }
    }
  }

  CellRow row(std::uint32_t y, std::uint32_t z) const {
    const std::uint32_t above = std::min(z + 1, dims_.z - 1);
    const Word even = extraction_.parity(0, y, z) == 0 ? kEvenX : ~kEvenX;
    return {dims_, extraction_.scheme, even, planes_[z % kPlanes], planes_[above % kPlanes], y, z};
  }

 private:
  static constexpr std::uint32_t kPlanes = 3;

  const Extraction<T>& extraction_;
  const Dims dims_;
  std::array<SignPlane, kPlanes> planes_;
  std::uint32_t next_;
};

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
