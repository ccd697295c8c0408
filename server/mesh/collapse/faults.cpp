// Compiled once for each instruction set: this file includes itself through Highway's
// foreach_target.h.
#include "server/mesh/collapse/faults.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/collapse/faults.cpp"
#include <algorithm>
#include <array>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/collapse/fast_clear-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::collapse::HWY_NAMESPACE {

template <class Test>
class FaultFinder {
 public:
  explicit FaultFinder(const TubeStart& start) : start_(start), clear_(start.surface.field) {}

  bool is_at_fault(const Triangle& triangle) {
    const auto& [a, b, c] = triangle;
    if ((start_.is_unclear[a] | start_.is_unclear[b] | start_.is_unclear[c]) != 0) return true;
    const Tube& tube = start_.tube;
    const Vertex& x = tube.vertices[a];
    const Vertex& y = tube.vertices[b];
    const Vertex& z = tube.vertices[c];
    const bool all_stepped = (start_.stepped[a] & start_.stepped[b] & start_.stepped[c]) != 0;
    const unsigned planes = tube.planes[a] & tube.planes[b] & tube.planes[c];
    if (!all_stepped && !is_upright(x, y, z, planes)) return true;
    const std::array<Lanes, 3> copies = {copies_of(x), copies_of(y), copies_of(z)};
    const float most = width_of(copies);
    if (!(most < kWidest)) return true;
    clear_.base(x.in, most);
    return !is_clear(triangle, copies, Side::kIn) || !is_clear(triangle, copies, Side::kOut);
  }

 private:
  // How far places of the copies are from each other, along an axis.
  static float width_of(const std::array<Lanes, 3>& copies) {
    const Lanes low = smaller(copies[0], smaller(copies[1], copies[2]));
    const Lanes high = larger(copies[0], larger(copies[1], copies[2]));
    float most = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      most =
          std::max(most, std::max(high[axis], high[axis + 4]) - std::min(low[axis], low[axis + 4]));
    }
    return most + 1;
  }

  HWY_INLINE bool is_clear(const Triangle& triangle, const std::array<Lanes, 3>& copies,
                           Side side) {
    const auto is_mine = [&](std::uint32_t from, std::uint32_t to) {
      // Else it is the neighbour's.
      return from < to || (start_.tube.border[from] & start_.tube.border[to]) != 0;
    };
    const double sign = side == Side::kIn ? 1 : -1;
    const auto x = clear_.at(copies[0], side);
    const auto y = clear_.at(copies[1], side);
    const auto z = clear_.at(copies[2], side);
    return (!is_mine(triangle[0], triangle[1]) || clear_.edge(x, y, sign)) &&
           (!is_mine(triangle[1], triangle[2]) || clear_.edge(y, z, sign)) &&
           (!is_mine(triangle[2], triangle[0]) || clear_.edge(z, x, sign)) &&
           clear_.inside(x, y, z, sign);
  }

  const TubeStart& start_;
  Test clear_;
};

template <class Test>
void find_with(const TubeStart& start, std::span<const std::uint32_t> triangles,
               std::vector<std::uint32_t>& faults) {
  FaultFinder<Test> finder(start);
  for (const std::uint32_t t : triangles) {
    if (finder.is_at_fault(start.corners(t))) faults.push_back(t);
  }
}

void find_faults_of_six(const TubeStart& start, std::span<const std::uint32_t> triangles,
                        std::vector<std::uint32_t>& faults) {
  find_with<FastClear<SixPlanes>>(start, triangles, faults);
}

void find_faults_of_five(const TubeStart& start, std::span<const std::uint32_t> triangles,
                         std::vector<std::uint32_t>& faults) {
  find_with<SlowClear<FivePlanes>>(start, triangles, faults);
}

void find_faults_of_bcc(const TubeStart& start, std::span<const std::uint32_t> triangles,
                        std::vector<std::uint32_t>& faults) {
  find_with<FastClear<BccPlanes>>(start, triangles, faults);
}

}  // namespace isomesh::mesh::collapse::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh::collapse {

HWY_EXPORT(find_faults_of_six);
HWY_EXPORT(find_faults_of_five);
HWY_EXPORT(find_faults_of_bcc);

void find_faults(const TubeStart& start, std::span<const std::uint32_t> triangles,
                 std::vector<std::uint32_t>& faults) {
  switch (start.surface.field.scheme) {
    case Scheme::kSix:
      return HWY_DYNAMIC_DISPATCH(find_faults_of_six)(start, triangles, faults);
    case Scheme::kFive:
      return HWY_DYNAMIC_DISPATCH(find_faults_of_five)(start, triangles, faults);
    case Scheme::kBcc:
      return HWY_DYNAMIC_DISPATCH(find_faults_of_bcc)(start, triangles, faults);
  }
}

}  // namespace isomesh::mesh::collapse
#endif  // HWY_ONCE
