// Finds the triangles of 64 cells that are left after crossings are joined. Compiled once for each
// instruction set, see slabs.cpp.
#if defined(ISOMESH_KEPT_TRIANGLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_KEPT_TRIANGLES_INL_H_
#undef ISOMESH_KEPT_TRIANGLES_INL_H_
#else
#define ISOMESH_KEPT_TRIANGLES_INL_H_
#endif

#include <array>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "server/mesh/lattice/rows-inl.h"
#include "server/mesh/lattice/tetrahedra.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

HWY_INLINE Word select(Word which, Word a, Word b) { return b ^ (which & (a ^ b)); }

// Those of a tetrahedron's two triangles that are left, in the order of tetrahedra.cpp. `inside`:
// of its four corners in their order. `merged`: the corners that join two of the crossings on their
// edges of the tetrahedron. Two crossings are joined at the corner that their edges share, or not
// at all: of two edges that share none, no cluster has both.
HWY_INLINE std::array<Word, 2> keep_triangles(const std::array<Word, 4>& inside,
                                              const std::array<Word, 4>& merged) {
  const auto [a, b, c, d] = inside;
  const auto [ma, mb, mc, md] = merged;
  const Word odd = a ^ b ^ c ^ d;
  const Word two = ((a | b | c | d) & ~(a & b & c & d)) & ~odd;
  // If two corners are inside and two outside, the first triangle has the crossings of the edges
  // first-first, first-second and second-second (inside-outside). So it vanishes if the first
  // inside or the second outside corner merges. The other triangle vanishes if the second inside or
  // the first outside corner merges.
  const Word lost_first = select(a, ma, select(b, mb, mc)) | select(d, select(c, mb, mc), md);
  const Word lost_second = select(d, md, select(c, mc, mb)) | select(a, select(b, mc, mb), ma);
  const Word lost_only = ma | mb | mc | md;  // those that are not the odd corner have one crossing
  return {(odd & ~lost_only) | (two & ~lost_first), two & ~lost_second};
}

// The majority of three, bit by bit.
HWY_INLINE Word two_of(Word a, Word b, Word c) { return (a & b) | (c & (a | b)); }

// `joined.at<a, b>()`: the cells whose crossing on the edge between corners a and b is joined at a.
template <Tetrahedron kCorners, class Joins>
HWY_INLINE std::array<Word, 2> keep_triangles_of(const CornerWords& signs, const Joins& joined) {
  constexpr unsigned a = kCorners[0];
  constexpr unsigned b = kCorners[1];
  constexpr unsigned c = kCorners[2];
  constexpr unsigned d = kCorners[3];
  return keep_triangles(
      {signs[a], signs[b], signs[c], signs[d]},
      {two_of(joined.template at<a, b>(), joined.template at<a, c>(), joined.template at<a, d>()),
       two_of(joined.template at<b, a>(), joined.template at<b, c>(), joined.template at<b, d>()),
       two_of(joined.template at<c, a>(), joined.template at<c, b>(), joined.template at<c, d>()),
       two_of(joined.template at<d, a>(), joined.template at<d, b>(), joined.template at<d, c>())});
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
