#include "server/mesh/signs.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace isomesh::mesh {
namespace {

constexpr Word kEvenX = 0x5555555555555555;

// Eight bytes of 0 or 1 to the eight bits of a byte, the first byte the lowest bit.
std::uint8_t pack_byte(const std::uint8_t* flags) {
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, flags, sizeof bytes);
  return static_cast<std::uint8_t>(bytes * 0x0102040810204080 >> 56);
}

unsigned count_in_tetrahedron(const CornerWords& corners,
                              const std::array<std::uint8_t, 4>& tetrahedron, Word cells) {
  const Word a = corners[tetrahedron[0]];
  const Word b = corners[tetrahedron[1]];
  const Word c = corners[tetrahedron[2]];
  const Word d = corners[tetrahedron[3]];
  const Word odd = (a ^ b ^ c ^ d) & cells;                          // one or three inside
  const Word mixed = ((a | b | c | d) & ~(a & b & c & d)) & cells;   // one, two or three
  return static_cast<unsigned>(std::popcount(odd) + 2 * std::popcount(mixed & ~odd));
}

}  // namespace

template <class T>
std::optional<T> smallest_inside(double iso) {
  if constexpr (std::is_floating_point_v<T>) {
    if (iso > static_cast<double>(std::numeric_limits<T>::max())) return std::nullopt;
    const auto nearest = static_cast<T>(std::max(iso, -double{std::numeric_limits<T>::max()}));
    return static_cast<double>(nearest) >= iso
               ? nearest
               : std::nextafter(nearest, std::numeric_limits<T>::infinity());
  } else {
    if (iso > static_cast<double>(std::numeric_limits<T>::max())) return std::nullopt;
    return static_cast<T>(
        std::ceil(std::max(iso, static_cast<double>(std::numeric_limits<T>::min()))));
  }
}

template <class T>
void classify(const Lattice<T>& lattice, std::uint32_t z, T smallest, SignPlane& plane) {
  const std::size_t width = lattice.dims.x;
  for (std::uint32_t y = 0; y < lattice.dims.y; ++y) {
    const T* samples = lattice.samples + (std::size_t{z} * lattice.dims.y + y) * width;
    Word* row = plane.row(y);
    for (std::size_t w = 0; w < plane.words(); ++w) {
      const std::size_t begin = w * kWordBits;
      const std::size_t count = std::min<std::size_t>(kWordBits, width - begin);
      std::array<std::uint8_t, kWordBits> flags = {};
      for (std::size_t x = 0; x < count; ++x) flags[x] = samples[begin + x] >= smallest ? 1 : 0;
      Word word = 0;
      for (unsigned byte = 0; byte < 8; ++byte) {
        word |= Word{pack_byte(flags.data() + byte * std::size_t{8})} << (byte * 8);
      }
      row[w] = word;
    }
  }
}

std::array<std::uint8_t, kWordBits> transpose(const std::array<Word, 8>& words) {
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

CellRow::CellRow(const Dims& dims, Scheme scheme, const SignPlane& low, const SignPlane& high,
                 std::uint32_t y, std::uint32_t z)
    : last_x_(dims.x - 1),
      has_y_(y + 1 < dims.y),
      has_z_(z + 1 < dims.z),
      five_(scheme == Scheme::kFive),
      even_(((y + z) & 1) == 0 ? kEvenX : ~kEvenX),
      even_x_(&cell_split(scheme, ((y + z) & 1) != 0)),
      odd_x_(&cell_split(scheme, ((y + z) & 1) == 0)) {
  const std::uint32_t next = has_y_ ? y + 1 : y;
  rows_[0] = low.row(y);
  rows_[1] = low.row(next);
  rows_[2] = high.row(y);
  rows_[3] = high.row(next);
}

bool CellRow::may_cross(std::size_t w) const {
  Word any = 0;
  Word all = ~Word{0};
  for (const Word* row : rows_) {
    any |= row[w] | row[w + 1] << 63;
    all &= row[w] & (row[w + 1] << 63 | ~Word{0} >> 1);
  }
  return any != 0 && all != ~Word{0};
}

CornerWords CellRow::corners(std::size_t w) const {
  CornerWords corners;
  for (unsigned r = 0; r < 4; ++r) {
    corners[std::size_t{2} * r] = rows_[r][w];
    corners[std::size_t{2} * r + 1] = rows_[r][w] >> 1 | rows_[r][w + 1] << 63;
  }
  return corners;
}

std::array<Word, 8> CellRow::crossed_edges(std::size_t w, const CornerWords& corners) const {
  const Word next_x = has_next(w);
  // Beyond the last x there are no samples at all.
  const Word here = next_x << 1 | (w == 0 ? 1 : has_next(w - 1) >> 63);
  std::array<Word, 8> crossed = {};
  for (unsigned direction = 1; direction < 8; ++direction) {
    if (((direction & 2) != 0 && !has_y_) || ((direction & 4) != 0 && !has_z_)) continue;
    Word edges = corners[0] ^ corners[direction];
    if (five_) {
      if (direction == 7) continue;
      const EdgeEnds odd = cell_split(Scheme::kFive, true).ends[direction];
      edges = (edges & even_) | ((corners[odd.from] ^ corners[odd.to]) & ~even_);
    }
    crossed[direction] = edges & ((direction & 1) != 0 ? next_x : here);
  }
  return crossed;
}

Word CellRow::crossed_cells(std::size_t w, const CornerWords& corners) const {
  if (!has_y_ || !has_z_) return 0;
  Word any = 0;
  Word all = ~Word{0};
  for (const Word corner : corners) {
    any |= corner;
    all &= corner;
  }
  return any & ~all & has_next(w);
}

unsigned CellRow::count_triangles(std::size_t w, const CornerWords& corners) const {
  const Word cells = crossed_cells(w, corners);
  if (cells == 0) return 0;
  unsigned count = 0;
  for (std::size_t t = 0; t < even_x_->tetrahedra; ++t) {
    count += count_in_tetrahedron(corners, even_x_->corners[t], five_ ? cells & kEvenX : cells);
    if (five_) count += count_in_tetrahedron(corners, odd_x_->corners[t], cells & ~kEvenX);
  }
  return count;
}

Word CellRow::has_next(std::size_t w) const {
  const std::size_t begin = w * kWordBits;
  if (begin + kWordBits <= last_x_) return ~Word{0};
  return begin >= last_x_ ? 0 : (Word{1} << (last_x_ - begin)) - 1;
}

#define ISOMESH_INSTANTIATE(T)                                                        \
  template std::optional<T> smallest_inside<T>(double);                               \
  template void classify(const Lattice<T>&, std::uint32_t, T, SignPlane&);
ISOMESH_INSTANTIATE(std::uint8_t)
ISOMESH_INSTANTIATE(std::int8_t)
ISOMESH_INSTANTIATE(std::uint16_t)
ISOMESH_INSTANTIATE(std::int16_t)
ISOMESH_INSTANTIATE(std::uint32_t)
ISOMESH_INSTANTIATE(std::int32_t)
ISOMESH_INSTANTIATE(float)
ISOMESH_INSTANTIATE(double)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
