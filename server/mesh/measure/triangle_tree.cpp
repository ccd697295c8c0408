#include "server/mesh/measure/triangle_tree.h"

#include <algorithm>
#include <cmath>

namespace isomesh::mesh {
namespace {

using Matrix = std::array<Point, 3>;

constexpr std::size_t kLeafTriangles = 8;

// Axes on which a symmetric, positive semidefinite matrix is nearly diagonal, as rows: Jacobi's
// rotations (G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition, 8.5), but only those
// that matter. So what lies along the coordinate axes stays there.
Matrix nearly_diagonal(Matrix m) {
  constexpr int kSweeps = 12;
  constexpr double kMatters = 0.7;  // of the smaller of two variances
  Matrix rows = {Point{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int turn = 0; turn < 3 * kSweeps; ++turn) {
    const std::size_t p = turn % 3 == 2 ? 1 : 0;
    const std::size_t q = turn % 3 == 0 ? 1 : 2;
    if (std::abs(m[p][q]) <= kMatters * std::min(m[p][p], m[q][q])) continue;
    const double cotangent = (m[q][q] - m[p][p]) / (2 * m[p][q]);
    const double tangent =
        std::copysign(1, cotangent) / (std::abs(cotangent) + std::hypot(cotangent, 1));
    const double cosine = 1 / std::hypot(tangent, 1);
    const double sine = tangent * cosine;
    const auto turn_pair = [&](double& a, double& b) {
      const double before = a;
      a = cosine * before - sine * b;
      b = sine * before + cosine * b;
    };
    for (std::size_t k = 0; k < 3; ++k) turn_pair(m[k][p], m[k][q]);
    for (std::size_t k = 0; k < 3; ++k) turn_pair(m[p][k], m[q][k]);
    for (std::size_t k = 0; k < 3; ++k) turn_pair(rows[p][k], rows[q][k]);
  }
  return rows;
}

Matrix principal_axes(const SurfaceView& surface, std::span<const TriangleInCell> entries) {
  Matrix moments = {};
  for (const TriangleInCell& entry : entries) {
    const Corners corners = corners_of(surface, entry.triangle);
    for (std::size_t i = 0; i < 3; ++i) {
      const Point edge = minus(corners[(i + 1) % 3], corners[i]);
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 3; ++column) {
          moments[row][column] += edge[row] * edge[column];
        }
      }
    }
  }
  return nearly_diagonal(moments);
}

}  // namespace

bool line_meets(const Point& low, const Point& high, const Point& from, const Point& to) {
  double enter = 0;
  double leave = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double way = to[axis] - from[axis];
    const double to_low = low[axis] - from[axis];
    const double to_high = high[axis] - from[axis];
    if (way == 0) {
      if (to_low > 0 || to_high < 0) return false;
      continue;
    }
    const auto [near, far] = std::minmax({to_low / way, to_high / way});
    enter = std::max(enter, near);
    leave = std::min(leave, far);
  }
  return enter <= leave;
}

TriangleTree::TriangleTree(const SurfaceView& surface, const Point& centre, double side_mm,
                           std::span<TriangleInCell> entries)
    : centre_(centre), side_mm_(side_mm), axes_(principal_axes(surface, entries)) {
  std::vector<Member> members;
  members.reserve(entries.size());
  for (const TriangleInCell& entry : entries) {
    members.push_back({box_of(corners_of(surface, entry.triangle)), entry});
  }
  build(members, 0, true);
  nodes_.shrink_to_fit();
  for (std::size_t n = 0; n < entries.size(); ++n) entries[n] = members[n].entry;
}

// Around the triangle, a little wider than rounding makes it.
TriangleTree::Box TriangleTree::box_of(const Corners& corners) const {
  Box box;
  box.low = box.high = lanes(turned(minus(corners[0], centre_)));
  for (const Point& corner : corners) {
    const Float4 at = lanes(turned(minus(corner, centre_)));
    box.low = at < box.low ? at : box.low;
    box.high = at > box.high ? at : box.high;
  }
  auto farthest = static_cast<float>(kNear * side_mm_);
  for (int axis = 0; axis < 3; ++axis) {
    farthest = std::max({farthest, -box.low[axis], box.high[axis]});
  }
  box.low -= kRounding * farthest;
  box.high += kRounding * farthest;
  return box;
}

// Contains the box.
std::uint32_t TriangleTree::packed(const Box& box, const Box& leaf) {
  std::array<std::uint32_t, 3> first = leaf.steps_of(box.low);
  std::array<std::uint32_t, 3> last = leaf.steps_of(box.high);
  for (bool is_enough = false; !is_enough;) {
    is_enough = true;
    const Box part = leaf.part(BoxInCell::of(first, last));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto lane = static_cast<int>(axis);
      const bool begins_later = first[axis] > 0 && part.low[lane] > box.low[lane];
      const bool ends_before =
          last[axis] < BoxInCell::kSteps - 1 && part.high[lane] < box.high[lane];
      if (begins_later) --first[axis];
      if (ends_before) ++last[axis];
      is_enough = is_enough && !begins_later && !ends_before;
    }
  }
  return BoxInCell::of(first, last);
}

void TriangleTree::build(std::span<Member> members, std::uint32_t first, bool may_part) {
  const std::size_t number = nodes_.size();
  Box bounds = members.front().box;
  for (const auto& [box, entry] : members) {
    bounds.low = box.low < bounds.low ? box.low : bounds.low;
    bounds.high = box.high > bounds.high ? box.high : bounds.high;
  }
  nodes_.push_back({bounds, first, static_cast<std::uint32_t>(first + members.size()), 0});
  if (members.size() <= kLeafTriangles) {
    for (Member& member : members) member.entry.box = packed(member.box, bounds);
    return;
  }
  // Not twice in turn, which keeps the tree low.
  const std::size_t large = may_part ? part_large(members, bounds) : 0;
  const std::size_t middle = large > 0 ? large : halve(members);
  build(members.first(middle), first, large == 0);
  nodes_[number].second = static_cast<std::uint32_t>(nodes_.size());
  build(members.subspan(middle), static_cast<std::uint32_t>(first + middle), large == 0);
}

// Puts the large members first and returns their number, if they are few: they would enlarge the
// boxes of the others at every level.
std::size_t TriangleTree::part_large(std::span<Member> members, const Box& bounds) {
  constexpr float kLarge = 0.5;
  constexpr std::size_t kFew = 4;  // at most one in so many
  const auto is_large = [large = kLarge * bounds.longest_side()](const Member& member) {
    return member.box.longest_side() > large;
  };
  const auto count = static_cast<std::size_t>(std::ranges::count_if(members, is_large));
  if (count == 0 || count > members.size() / kFew) return 0;
  std::partition(members.begin(), members.end(), is_large);
  return count;
}

// Halves the members along the axis on which their centres are spread farthest, compared with their
// sides: so the halves overlap least. Returns the half.
std::size_t TriangleTree::halve(std::span<Member> members) {
  const auto twice_centre = [](const Member& member) { return member.box.low + member.box.high; };
  Float4 low = twice_centre(members.front());
  Float4 high = low;
  Float4 sides = {};
  for (const Member& member : members) {
    const Float4 at = twice_centre(member);
    low = at < low ? at : low;
    high = at > high ? at : high;
    sides += member.box.high - member.box.low;
  }
  const Float4 spread = high - low;
  int widest = 0;
  for (const int axis : {1, 2}) {
    if (spread[axis] * sides[widest] > spread[widest] * sides[axis]) widest = axis;
  }
  const std::size_t half = members.size() / 2;
  std::nth_element(members.begin(), members.begin() + static_cast<std::ptrdiff_t>(half),
                   members.end(), [&](const Member& one, const Member& other) {
                     return one.box.low[widest] + one.box.high[widest] <
                            other.box.low[widest] + other.box.high[widest];
                   });
  return half;
}

}  // namespace isomesh::mesh
