// Compiled once for each instruction set: this file includes itself through Highway's
// foreach_target.h.
#include "server/mesh/collapse/collapse_block.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/collapse/collapse_block.cpp"
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/collapse/corners.h"
#include "server/mesh/collapse/quadric.h"
#include "server/mesh/collapse/star-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::collapse::HWY_NAMESPACE {

constexpr int kBuckets = 64;  // of costs
constexpr int kEasy = 12;     // buckets below which an edge's end is tried before the best place
constexpr float kLargestCost = 1.5F;  // of the reach, as a distance
constexpr std::size_t kTries = 2;     // edges of a vertex
constexpr float kShift = 0.4F;        // of the reach: away from a side that fails by little

// Lengths are in the unit of the surroundings.
template <class Test>
class Collapser {
 public:
  Collapser(const CollapseSurroundings& around, Block& block)
      : field_(around.field),
        metric_(around.metric),
        reach_(static_cast<float>(around.reach)),
        block_(block),
        corners_(block.triangles, block.vertices.size()),
        star_(around.field, around.metric, reach_) {
    if (!block.vertices.empty()) origin_ = block.vertices.front().p;
  }

  void run(std::size_t least) {
    const std::size_t count = block_.vertices.size();
    sites_.reserve(count);
    nodes_.reserve(count);
    for (std::uint32_t a = 0; a < count; ++a) {
      block_.stays[a] |= static_cast<std::uint8_t>(corners_.is_on_seam(a));
      sites_.push_back(site_of(block_.vertices[a], block_.planes[a]));
      nodes_.push_back({{}, place_of(block_.vertices[a]), block_.stays[a] != 0});
    }
    make_quadrics();
    bucket_.assign(count, -1);
    for (std::uint32_t a = 0; a < count; ++a) {
      if (block_.first[a] != 0) push(a, 0);
    }
    for (int bucket = 0; bucket < kBuckets; ++bucket) {
      for (std::size_t k = 0; k < queue_[bucket].size() && corners_.left() > least; ++k) {
        const std::uint32_t a = queue_[bucket][k];
        if (bucket_[a] != bucket) continue;
        bucket_[a] = -1;
        try_vertex(a, bucket);
      }
    }
    block_.triangles = corners_.triangles();
  }

 private:
  // The data for computing costs, in one cache line.
  struct alignas(64) Node {
    Quadric quadric;  // about the place
    Vecf place;       // from the block's first vertex
    bool stays = false;
  };

  bool stays(std::uint32_t a) const { return nodes_[a].stays; }
  Vecf way(std::uint32_t a, std::uint32_t b) const { return nodes_[b].place - nodes_[a].place; }

  Vecf place_of(const Vertex& vertex) const { return metric_.mm(vertex.p - origin_); }
  Site site_of(const Vertex& vertex, unsigned planes) const {
    Site site = {.copies = {},
                 .up = metric_.mm(vertex.in - vertex.p),
                 .down = metric_.mm(vertex.p - vertex.out),
                 .planes = planes};
    store(copies_of(vertex), site.copies.data());
    return site;
  }

  void make_quadrics() {
    for (const auto& [a, b, c] : block_.triangles) {
      const Quadric plane = Quadric::of_plane(cross(way(a, b), way(a, c)));
      for (const std::uint32_t x : {a, b, c}) nodes_[x].quadric = nodes_[x].quadric + plane;
    }
  }

  // At least that of both at one of their places.
  float cost(std::uint32_t a, std::uint32_t b) const {
    const Vecf d = way(a, b);
    const float at_b = nodes_[a].quadric.at(d) + nodes_[b].quadric.c;
    return stays(b) ? at_b : std::min(at_b, nodes_[b].quadric.at(d * -1.0F) + nodes_[a].quadric.c);
  }

  int bucket_of(float cost, float weight) const {
    const float distance = std::sqrt(cost / (weight + 1e-20F)) / reach_;
    return static_cast<int>(std::min<float>(kBuckets, distance * (kBuckets / kLargestCost)));
  }

  void put(std::uint32_t a, int bucket) {
    if (bucket >= kBuckets || (bucket_[a] >= 0 && bucket_[a] <= bucket)) return;
    bucket_[a] = bucket;
    queue_[bucket].push_back(a);
  }

  void push(std::uint32_t a, int at_least) {
    if (stays(a) || corners_.is_gone(a)) return;
    float best = 1e30F;
    corners_.visit_neighbours(a, [&](std::uint32_t b) { best = std::min(best, cost(a, b)); });
    put(a, std::max(at_least, bucket_of(best, nodes_[a].quadric.weight)));
  }

  // Like push(), if only the edge to `b` is new.
  void push_edge(std::uint32_t a, std::uint32_t b, int at_least) {
    if (stays(a) || corners_.is_gone(a)) return;
    put(a, std::max(at_least, bucket_of(cost(a, b), nodes_[a].quadric.weight)));
  }

  void try_vertex(std::uint32_t a, int bucket) {
    if (!corners_.walk_around(a)) return;
    const std::vector<std::uint32_t>& ring = corners_.ring();
    std::array<std::pair<float, std::size_t>, Corners::kMostNeighbours> order;
    for (std::size_t k = 0; k < ring.size(); ++k) order[k] = {cost(a, ring[k]), k};
    for (std::size_t k = 0; k < std::min(kTries, ring.size()); ++k) {
      const auto least = std::min_element(order.begin() + k, order.begin() + ring.size());
      std::swap(order[k], *least);
      if (bucket_of(order[k].first, nodes_[a].quadric.weight) >= kBuckets) return;
      const std::size_t to = order[k].second;
      if (corners_.keeps_topology(to) && collapse(a, to, bucket)) return;
    }
  }

  bool collapse(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = corners_.ring()[k];
    const unsigned of_a = block_.planes[a];
    const unsigned of_b = block_.planes[b];
    // Caps stay in the faces of the volume, and their edges in both.
    if ((of_a & ~of_b) != 0) return false;
    if (stays(b) || of_a != of_b) return to_end(a, k, bucket);
    if (bucket < kEasy) return to_end(a, k, bucket) || to_best(a, k, bucket);
    return to_best(a, k, bucket) || to_end(a, k, bucket);
  }

  // a to ring()[k], which stays where it is.
  bool to_end(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = corners_.ring()[k];
    if (!make_star(k, false)) return false;
    const Vecf place = nodes_[b].place;
    if (!star_.is_shapely(sites_[b], place) || !star_.is_clear(sites_[b])) return false;
    finish(a, k, bucket, nodes_[a].quadric + nodes_[b].quadric.about(way(b, a)), place);
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
    finish(a, k, bucket, both, place_of(vertex));
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

  Vertex place(std::uint32_t a, Vecf way, Vecf reach) const {
    const Vecf from = block_.vertices[a].p;
    Vecf p = snap(wide(from) + metric_.steps(wide(way)));
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

  // Gives a's triangles to ring()[k]; `quadric` is about a's place, `p` the new one of ring()[k].
  void finish(std::uint32_t a, std::size_t k, int bucket, const Quadric& quadric, Vecf p) {
    const std::uint32_t b = corners_.ring()[k];
    nodes_[b].quadric = quadric.about(p - nodes_[a].place);
    nodes_[b].place = p;
    corners_.collapse(k);
    bucket_[a] = -1;
    bucket_[b] = -1;
    push(b, bucket);
    for (const std::uint32_t r : corners_.ring()) {
      if (r != b) push_edge(r, b, bucket);
    }
  }

  const Field& field_;
  const Metric& metric_;
  const float reach_;
  Block& block_;
  Corners corners_;
  Star<Test> star_;
  Vecf origin_;
  std::vector<Site> sites_;
  std::vector<Node> nodes_;
  std::vector<int> bucket_;
  std::array<std::vector<std::uint32_t>, kBuckets> queue_;
  std::vector<std::uint32_t> loop_;
};

void collapse_six(const CollapseSurroundings& around, std::size_t least, Block& block) {
  Collapser<FastClear<SixPlanes>>(around, block).run(least);
}

void collapse_five(const CollapseSurroundings& around, std::size_t least, Block& block) {
  Collapser<SlowClear<FivePlanes>>(around, block).run(least);
}

void collapse_bcc(const CollapseSurroundings& around, std::size_t least, Block& block) {
  Collapser<FastClear<BccPlanes>>(around, block).run(least);
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
