#include "server/mesh/lattice/bcc_faces.h"

#include <span>
#include <utility>

#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

constexpr unsigned kFirstCorner = 2;

using Place = std::array<int, 3>;  // in half cells

// Builds the cases of one face.
class FaceBuilder {
 public:
  FaceBuilder(unsigned axis, BccSide side, bool left_handed)
      : axis_(axis), side_(side), left_handed_(left_handed) {}

  BccFace build() const {
    const bool is_inner = side_ == BccSide::kInner;
    const auto tetrahedra = is_inner ? std::span<const Tetrahedron>(kBccInnerTetrahedra)
                                     : std::span<const Tetrahedron>(kBccBorderTetrahedra);
    BccFace face;
    for (unsigned inside = 0; inside < face.triangles.size(); ++inside) {
      for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
        const unsigned added = add(tetrahedra[t], inside, &face.triangles[inside][2 * t]);
        face.present[inside] |= static_cast<std::uint8_t>(((1U << added) - 1) << 2 * t);
      }
    }
    return face;
  }

 private:
  using Named = std::array<std::uint8_t, 4>;

  // The lattice point that a point of the tables stands for.
  unsigned real(unsigned point) const { return point == 0 && side_ == BccSide::kLow ? 1 : point; }

  Place place(unsigned point) const {
    Place result = {1, 1, 1};
    if (point < kFirstCorner) {
      result[axis_] = point == 0 ? -1 : 1;
      return result;
    }
    const unsigned corner = bcc_corners(axis_)[point - kFirstCorner];
    for (unsigned a = 0; a < 3; ++a) result[a] = static_cast<int>(corner >> a & 1) * 2;
    return result;
  }

  // Writes the triangles of a tetrahedron, up to two, and returns how many.
  unsigned add(const Tetrahedron& tetrahedron, unsigned inside, Named* next) const {
    std::array<unsigned, 4> in = {};
    std::array<unsigned, 4> out = {};
    std::size_t ins = 0;
    std::size_t outs = 0;
    for (const unsigned listed : tetrahedron) {
      const unsigned point = real(listed);
      ((inside >> point & 1) != 0 ? in[ins++] : out[outs++]) = point;
    }
    if (ins == 1) {
      const bool turn = volume(in[0], out[0], out[1], out[2]) < 0;
      next[0] = triangle({in[0], out[0]}, {in[0], out[1]}, {in[0], out[2]}, turn);
      return 1;
    }
    if (ins == 3) {
      const bool turn = volume(out[0], in[0], in[1], in[2]) > 0;
      next[0] = triangle({in[0], out[0]}, {in[1], out[0]}, {in[2], out[0]}, turn);
      return 1;
    }
    if (ins != 2) return 0;
    const bool turn = volume(in[0], in[1], out[0], out[1]) < 0;
    next[0] = triangle({in[0], out[0]}, {in[0], out[1]}, {in[1], out[1]}, turn);
    next[1] = triangle({in[0], out[0]}, {in[1], out[1]}, {in[1], out[0]}, turn);
    return 2;
  }

  int volume(unsigned from, unsigned a, unsigned b, unsigned c) const {
    const auto way = [&](unsigned to) { return minus(place(to), place(from)); };
    return dot(way(a), cross(way(b), way(c)));
  }

  using Ends = std::array<unsigned, 2>;

  Named triangle(Ends a, Ends b, Ends c, bool turn) const {
    if (turn != left_handed_) std::swap(b, c);
    return {named(a), named(b), named(c)};
  }

  static std::uint8_t named(const Ends& ends) {
    return static_cast<std::uint8_t>(bcc_edge_between(ends[0], ends[1]));
  }

  const unsigned axis_;
  const BccSide side_;
  const bool left_handed_;
};

BccFaces make_faces(bool left_handed) {
  BccFaces faces;
  for (unsigned axis = 0; axis < 3; ++axis) {
    for (const BccSide side : kBccSides) {
      faces[axis][static_cast<std::size_t>(side)] = FaceBuilder(axis, side, left_handed).build();
    }
  }
  return faces;
}

}  // namespace

const BccFaces& bcc_faces(bool left_handed) {
  static const BccFaces right = make_faces(false);
  static const BccFaces left = make_faces(true);
  return left_handed ? left : right;
}

}  // namespace isomesh::mesh
