// Compiled once for each instruction set: this file includes itself through Highway's
// foreach_target.h.
#include "server/mesh/collapse/collapse_block.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/collapse/collapse_block.cpp"
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/collapse/collapser.h"
#include "server/mesh/collapse/star-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::collapse::HWY_NAMESPACE {

constexpr int kEasy = 8;  // buckets below which only an edge's end is tried, not the best place
constexpr float kLargestCost = 1.5F;  // of the reach, as a distance
constexpr float kShift = 0.4F;        // of the reach: away from a side that fails by little

// Lengths are in the unit of the surroundings.
template <class Test>
class Prover : private Collapser<Prover<Test>> {
  using Base = Collapser<Prover>;
  friend Base;

 public:
  Prover(const CollapseSurroundings& around, Block& block)
      : Base(block.patch.triangles, block.vertices.size()),
        field_(around.field),
        metric_(around.metric),
        reach_(static_cast<float>(around.reach)),
        block_(block),
        star_(around.field, around.metric, reach_) {
    if (!block.vertices.empty()) origin_ = block.vertices.front().p;
  }

  void run(std::size_t least) {
    Patch& patch = block_.patch;
    sites_.reserve(block_.vertices.size());
    for (std::uint32_t a = 0; a < block_.vertices.size(); ++a) {
      patch.stays[a] |= static_cast<std::uint8_t>(corners_.is_on_seam(a));
      sites_.push_back(site_of(block_.vertices[a], block_.planes[a]));
      nodes_.push_back({{}, place_of(block_.vertices[a]), patch.stays[a] != 0});
    }
    Base::make_quadrics(patch.triangles);
    Base::run(least, patch.first);
    corners_.take(patch.triangles, patch.numbers);
  }

 private:
  using Base::corners_;
  using Base::nodes_;
  using Base::stays;
  using Base::way;

  static constexpr int kBuckets = 64;
  static constexpr std::size_t kTries = 2;
  static constexpr std::size_t kLeastNeighbours = 4;
  static constexpr std::size_t kMostNeighbours = Corners::kMostNeighbours;
  static constexpr bool kInOrder = false;
  static constexpr bool kMovesTheOther = true;

  int bucket_of(float cost, float weight) const {
    const float distance = std::sqrt(cost / (weight + 1e-20F)) / reach_;
    return static_cast<int>(std::min<float>(kBuckets, distance * (kBuckets / kLargestCost)));
  }

  Vecf place_of(const Vertex& vertex) const { return metric_.mm(vertex.p - origin_); }
  Site site_of(const Vertex& vertex, unsigned planes) const {
    Site site = {.copies = {},
                 .up = metric_.mm(vertex.in - vertex.p),
                 .down = metric_.mm(vertex.p - vertex.out),
                 .planes = planes};
    store(copies_of(vertex), site.copies.data());
    return site;
  }

  bool collapse(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = corners_.ring()[k];
    const unsigned of_a = block_.planes[a];
    const unsigned of_b = block_.planes[b];
    // Caps stay in the faces of the volume, and their edges in both.
    if ((of_a & ~of_b) != 0) return false;
    if (stays(b) || of_a != of_b || bucket < kEasy) return to_end(a, k, bucket);
    return to_best(a, k, bucket) || to_end(a, k, bucket);
  }

  // a to ring()[k], which stays where it is.
  bool to_end(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = corners_.ring()[k];
    if (!make_star(k, false)) return false;
    const Vecf place = nodes_[b].place;
    if (!star_.is_shapely(sites_[b], place) || !star_.is_clear(sites_[b])) return false;
    Base::finish(a, k, bucket, nodes_[a].quadric + nodes_[b].quadric.about(way(b, a)), place);
    return true;
  }

  // Both to where their quadric is least, and from there a little away from a side that fails.
  bool to_best(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = corners_.ring()[k];
    if (!make_star(k, true)) return false;
    Vecf normal;
    for (std::size_t i = 1; i + 1 < loop_.size(); ++i) {
      normal = normal + cross(way(loop_[0], loop_[i]), way(loop_[0], loop_[i + 1]));
    }
    const float size = length(normal) * metric_.turn();
    if (!(std::abs(size) > 1e-12F)) return false;
    const Vecf reach = normal * (reach_ / size);
    const Vecf half = way(a, b) * 0.5F;
    const Quadric both = nodes_[a].quadric + nodes_[b].quadric.about(half * -2.0F);
    const Vecf best = half + both.about(half).least(3 * length(half));
    Vertex vertex = place(a, best, reach);
    Site site = site_of(vertex, block_.planes[a]);
    if (!is_within(vertex.p, a) || !star_.is_shapely(site, place_of(vertex))) return false;
    const auto [is_clear, failed] = star_.judge(site, kShift / 2);
    if (!is_clear) {
      if (!failed) return false;
      vertex = place(a, best + reach * (*failed == Side::kIn ? kShift : -kShift), reach);
      site = site_of(vertex, block_.planes[a]);
      if (!is_within(vertex.p, a) || !star_.is_shapely(site, place_of(vertex)) ||
          !star_.is_clear(site)) {
        return false;
      }
    }
    block_.vertices[b] = vertex;
    sites_[b] = site;
    Base::finish(a, k, bucket, both, place_of(vertex));
    return true;
  }

  // Builds the star of the new vertex: the neighbours of `a` alone, or of both ends. Returns false
  // if there are too many.
  bool make_star(std::size_t k, bool both) {
    if (!corners_.make_loop(k, both, loop_)) return false;
    star_.clear();
    for (const std::uint32_t v : loop_) star_.add(sites_[v], nodes_[v].place);
    star_.close(both);
    return true;
  }

  Vertex place(std::uint32_t a, Vecf by, Vecf reach) const {
    const Vecf from = block_.vertices[a].p;
    Vecf p = snap(wide(from) + metric_.steps(wide(by)));
    const unsigned planes = block_.planes[a];
    if ((planes & 0b000011) != 0) p.x = from.x;
    if ((planes & 0b001100) != 0) p.y = from.y;
    if ((planes & 0b110000) != 0) p.z = from.z;
    const Vecd copy = metric_.steps(wide(reach));
    return {p, snap(wide(p) + copy), snap(wide(p) - copy)};
  }

  // Beside caps a surface stays on their inner side, or it would cross them.
  bool is_within(Vecf p, std::uint32_t a) const {
    return field_.margin == 0 || block_.planes[a] != 0 || field_.encloses(p);
  }

  const Field& field_;
  const Metric& metric_;
  const float reach_;
  Block& block_;
  Star<Test> star_;
  Vecf origin_;
  std::vector<Site> sites_;
  std::vector<std::uint32_t> loop_;
};

void collapse_six(const CollapseSurroundings& around, std::size_t least, Block& block) {
  Prover<FastClear<SixPlanes>>(around, block).run(least);
}

void collapse_five(const CollapseSurroundings& around, std::size_t least, Block& block) {
  Prover<SlowClear<FivePlanes>>(around, block).run(least);
}

void collapse_bcc(const CollapseSurroundings& around, std::size_t least, Block& block) {
  Prover<FastClear<BccPlanes>>(around, block).run(least);
}

}  // namespace isomesh::mesh::collapse::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh::collapse {

HWY_EXPORT(collapse_six);
HWY_EXPORT(collapse_five);
HWY_EXPORT(collapse_bcc);

void collapse_block(const CollapseSurroundings& around, std::size_t least, Block& block) {
  switch (around.field.scheme) {
    case Scheme::kSix:
      return HWY_DYNAMIC_DISPATCH(collapse_six)(around, least, block);
    case Scheme::kFive:
      return HWY_DYNAMIC_DISPATCH(collapse_five)(around, least, block);
    case Scheme::kBcc:
      return HWY_DYNAMIC_DISPATCH(collapse_bcc)(around, least, block);
  }
}

}  // namespace isomesh::mesh::collapse
#endif  // HWY_ONCE
