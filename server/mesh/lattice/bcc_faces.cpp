#include "server/mesh/lattice/bcc_faces.h"

#include <algorithm>
#include <span>
#include <utility>

#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

constexpr unsigned kPoints = 6;
constexpr unsigned kFirstCorner = 2;
constexpr std::uint8_t kNone = 0xFF;

using Place = std::array<int, 3>;  // in half cells

// Builds the cases of one face.
class FaceBuilder {
 public:
  FaceBuilder(unsigned axis, BccSide side, bool left_handed)
      : axis_(axis), side_(side), left_handed_(left_handed) {
    for (auto& row : numbers_) row.fill(kNone);
    number_edges();
  }

  BccFace build() {
    for (unsigned inside = 0; inside < face_.cases.size(); ++inside) {
      for (const auto& tetrahedron : tetrahedra()) add(tetrahedron, inside);
    }
    return face_;
  }

 private:
  using Points = std::array<std::uint8_t, 4>;

  std::span<const Points> tetrahedra() const {
    if (side_ == BccSide::kInner) return kBccInnerTetrahedra;
    return std::span(kBccBorderTetrahedra).first(2);
  }

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

  // In the order of bcc_face_edges.
  void number_edges() {
    auto number = [this, next = std::uint8_t{0}](unsigned a, unsigned b) mutable {
      numbers_[a][b] = numbers_[b][a] = next++;
    };
    if (side_ == BccSide::kInner) {
      number(0, 1);
    } else {
      number(2, 4);
    }
    for (unsigned centre = 0; centre < kFirstCorner; ++centre) {
      for (unsigned corner = kFirstCorner; corner < kPoints; ++corner) number(centre, corner);
    }
    number(2, 3);
    number(3, 4);
    number(4, 5);
    number(2, 5);
  }

  void add(const Points& tetrahedron, unsigned inside) {
    std::array<unsigned, 4> in = {};
    std::array<unsigned, 4> out = {};
    std::size_t ins = 0;
    std::size_t outs = 0;
    for (const unsigned listed : tetrahedron) {
      const unsigned point = real(listed);
      ((inside >> point & 1) != 0 ? in[ins++] : out[outs++]) = point;
    }
    BccFaceCase& result = face_.cases[inside];
    if (ins == 1) {
      const bool turn = volume(in[0], out[0], out[1], out[2]) < 0;
      add_triangle(result, {in[0], out[0]}, {in[0], out[1]}, {in[0], out[2]}, turn);
    } else if (ins == 3) {
      const bool turn = volume(out[0], in[0], in[1], in[2]) > 0;
      add_triangle(result, {in[0], out[0]}, {in[1], out[0]}, {in[2], out[0]}, turn);
    } else if (ins == 2) {
      const bool turn = volume(in[0], in[1], out[0], out[1]) < 0;
      add_triangle(result, {in[0], out[0]}, {in[0], out[1]}, {in[1], out[1]}, turn);
      add_triangle(result, {in[0], out[0]}, {in[1], out[1]}, {in[1], out[0]}, turn);
    }
  }

  int volume(unsigned from, unsigned a, unsigned b, unsigned c) const {
    const auto way = [&](unsigned to) { return minus(place(to), place(from)); };
    return dot(way(a), cross(way(b), way(c)));
  }

  using Ends = std::array<unsigned, 2>;

  void add_triangle(BccFaceCase& result, Ends a, Ends b, Ends c, bool turn) const {
    if (turn != left_handed_) std::swap(b, c);
    result.triangles[result.triangle_count++] = {named(a), named(b), named(c)};
  }

  std::uint8_t named(const Ends& ends) const { return numbers_[ends[0]][ends[1]]; }

  const unsigned axis_;
  const BccSide side_;
  const bool left_handed_;
  BccFace face_;
  std::array<std::array<std::uint8_t, kPoints>, kPoints> numbers_ = {};
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
