#include "server/mesh/collapse/simplify_patch.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/mesh/collapse/collapser.h"
#include "server/mesh/points.h"

namespace isomesh::mesh::collapse {
namespace {

using mesh::dot;

// No triangle is turned farther than this by one collapse.
constexpr double kLeastCosine = 0.25;
constexpr std::size_t kTriesPerLook = 1024;  // at whether the job is cancelled

class Simplifier : private Collapser<Simplifier> {
  using Base = Collapser<Simplifier>;
  friend Base;

 public:
  Simplifier(const SimplifySurroundings& around, Patch& patch)
      : Base(patch.triangles, patch.names.size()),
        around_(around),
        patch_(patch),
        most_(static_cast<float>(std::pow(around.max_error_mm / around.unit_mm, 2))) {
    std::vector<std::uint8_t> is_whole;
    for (std::uint32_t v = 0; v < patch.names.size(); ++v) {
      if (patch.stays[v] != 0) corners_.put_on_seam(v);
      is_whole.push_back((patch.stays[v] & kIsElsewhere) == 0);
      patch.stays[v] |= corners_.is_on_seam(v) ? kStays : 0;
      const auto [x, y, z] = minus(at(v), at(0));
      const Vecf place = narrow(Vecd{x, y, z} * (1 / around.unit_mm));
      nodes_.push_back({{}, place, corners_.is_on_seam(v)});
    }
    corners_.set_whole(std::move(is_whole));
    make_quadrics(patch.triangles);
  }

  void run(std::size_t least, bool is_last) {
    Base::run(least, patch_.first);
    const std::vector<std::uint8_t> all(patch_.names.size(), 1);
    for (const bool may_turn : {false, true}) {
      may_turn_ = may_turn;
      for (std::size_t before = 0;
           is_last && corners_.left() > least && before != corners_.left();) {
        before = corners_.left();
        Base::run(least, all);
      }
    }
    corners_.take(patch_.triangles, patch_.numbers);
  }

 private:
  static constexpr int kBuckets = 2048;
  static constexpr std::size_t kTries = 256;
  static constexpr std::size_t kLeastNeighbours = 3;
  static constexpr std::size_t kMostNeighbours = 256;  // to look at takes the square of it
  static constexpr bool kInOrder = true;
  static constexpr bool kMovesTheOther = false;

  // A number's exponent and first bits say its order.
  int bucket_of(float cost, float weight) const {
    if (cost > most_ * weight) return kBuckets;
    return static_cast<int>(std::bit_cast<std::uint32_t>(cost) >> 20);
  }

  bool collapse(std::uint32_t a, std::size_t k, int bucket) {
    if (++tries_ % kTriesPerLook == 0) around_.context.throw_if_stopped();
    const std::vector<std::uint32_t>& ring = corners_.ring();
    const std::uint32_t b = ring[k];
    star_.clear();
    shapes_.clear();
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const std::size_t next = i + 1 < ring.size() ? i + 1 : 0;
      star_.push_back(number(corners_.triangle_behind(i)));
      if (i == k || next == k) continue;
      const mesh::Corners corners = {at(b), at(ring[i]), at(ring[next])};
      if (!is_upright(at(a), corners)) return false;
      shapes_.push_back({star_.back(), corners});
    }
    if (around_.points != nullptr && !around_.points->replace(star_, shapes_)) return false;
    if (around_.history != nullptr) {
      around_.history->add({patch_.names[a], patch_.names[b], around_.step + collapses_});
    }
    ++collapses_;
    const Quadric& of_b = nodes_[b].quadric;
    finish(a, k, bucket, nodes_[a].quadric + of_b.about(way(b, a)), nodes_[b].place);
    return true;
  }

  // True if a triangle may become this one, which had a corner at `before` instead of its first.
  bool is_upright(const Point& before, const mesh::Corners& corners) const {
    const Point normal = normal_of(corners[0], corners[1], corners[2]);
    if (may_turn_) return normal != Point{0, 0, 0};
    const Point old = normal_of(before, corners[1], corners[2]);
    const double lengths = std::sqrt(dot(old, old) * dot(normal, normal));
    return lengths > 0 && dot(old, normal) > kLeastCosine * lengths;
  }

  Point at(std::uint32_t v) const { return to_point(around_.mesh.positions[patch_.names[v]]); }
  std::uint32_t number(std::uint32_t triangle) const { return patch_.numbers[triangle]; }

  const SimplifySurroundings& around_;
  Patch& patch_;
  const float most_;  // as a squared distance
  bool may_turn_ = false;
  std::size_t tries_ = 0;
  std::uint32_t collapses_ = 0;
  std::vector<std::uint32_t> star_;
  std::vector<KeptPoints::Shape> shapes_;
};

}  // namespace

void simplify_patch(const SimplifySurroundings& around, std::size_t least, bool is_last,
                    Patch& patch) {
  Simplifier(around, patch).run(least, is_last);
}

}  // namespace isomesh::mesh::collapse
