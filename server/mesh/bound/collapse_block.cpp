#include "server/mesh/bound/collapse_block.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace isomesh::mesh::bound {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};
constexpr std::size_t kMostNeighbours = 28;
constexpr int kBuckets = 64;  // of costs
constexpr int kEasy = 12;     // buckets below which an edge's end is tried before the best place
constexpr double kLargestCost = 1.5;  // of the reach, as a distance
constexpr std::size_t kTries = 2;     // edges of a vertex
constexpr float kLeastShape = 0.02F;  // twice a triangle's area by its longest edge's square
constexpr float kShift = 0.4F;        // of the reach: away from a side that fails by little

// The corner c is the corner c % 3 of the triangle c / 3.
std::uint32_t next(std::uint32_t c) { return c % 3 == 2 ? c - 2 : c + 1; }
std::uint32_t previous(std::uint32_t c) { return c % 3 == 0 ? c + 2 : c - 1; }

class Collapser {
 public:
  Collapser(const Field& field, const Metric& metric, double reach_mm, Block& block)
      : field_(field),
        metric_(metric),
        reach_(static_cast<float>(reach_mm)),
        block_(block),
        clear_(field),
        v_(block.vertices),
        triangles_(block.triangles),
        alive_(block.triangles.size()) {}

  void run(std::size_t least) {
    join_corners();
    find_boundary();
    make_quadrics();
    bucket_.assign(v_.size(), -1);
    for (std::uint32_t a = 0; a < v_.size(); ++a) {
      if (block_.first[a] != 0) push(a, 0);
    }
    for (int bucket = 0; bucket < kBuckets; ++bucket) {
      for (std::size_t k = 0; k < queue_[bucket].size() && alive_ > least; ++k) {
        const std::uint32_t a = queue_[bucket][k];
        if (bucket_[a] != bucket) continue;
        bucket_[a] = -1;
        try_vertex(a, bucket);
      }
    }
    std::erase_if(triangles_, [](const Triangle& triangle) { return triangle[0] == kNone; });
  }

 private:
  enum class Side { kIn, kOut };
  struct Verdict {
    bool is_clear = false;
    std::optional<Side> failed;  // alone, and by so little that moving may help
  };

  std::uint32_t& at(std::uint32_t corner) { return triangles_[corner / 3][corner % 3]; }
  bool stays(std::uint32_t a) const { return block_.stays[a] != 0; }
  std::uint32_t turn(std::uint32_t corner) const { return next(opposite_[next(corner)]); }
  Vecf way(std::uint32_t a, std::uint32_t b) const { return metric_.mm(v_[b].p - v_[a].p); }

  void join_corners() {
    const auto corners = static_cast<std::uint32_t>(3 * triangles_.size());
    opposite_.assign(corners, kNone);
    corner_.assign(v_.size(), kNone);
    is_seam_.assign(v_.size(), 0);
    std::vector<std::uint32_t> head(v_.size(), kNone);
    std::vector<std::uint32_t> follow(corners);
    for (std::uint32_t c = 0; c < corners; ++c) {
      std::uint32_t& first = head[at(next(c))];
      follow[c] = first;
      first = c;
      corner_[at(c)] = c;
    }
    for (std::uint32_t c = 0; c < corners; ++c) {  // the edge a -> b opposite c; its twin is b -> a
      const std::uint32_t a = at(next(c));
      const std::uint32_t b = at(previous(c));
      std::uint32_t twin = kNone;
      int found = 0;
      int same = 0;
      for (std::uint32_t d = head[b]; d != kNone; d = follow[d]) {
        if (at(previous(d)) != a) continue;
        twin = d;
        ++found;
      }
      for (std::uint32_t d = head[a]; d != kNone; d = follow[d]) same += at(previous(d)) == b;
      if (found == 1 && same == 1) {
        opposite_[c] = twin;
      } else {
        is_seam_[a] = is_seam_[b] = 1;
      }
    }
  }

  // Vertices without one closed fan of triangles stay.
  void find_boundary() {
    std::vector<std::uint32_t> degree(v_.size(), 0);
    for (const Triangle& triangle : triangles_) {
      for (const std::uint32_t a : triangle) ++degree[a];
    }
    for (std::uint32_t a = 0; a < v_.size(); ++a) {
      if (corner_[a] == kNone) is_seam_[a] = 1;
      if (is_seam_[a] == 0) {
        std::uint32_t count = 0;
        std::uint32_t c = corner_[a];
        do {
          c = turn(c);
          ++count;
        } while (c != corner_[a] && count <= degree[a]);
        if (count != degree[a]) is_seam_[a] = 1;
      }
      block_.stays[a] |= is_seam_[a];
    }
  }

  void make_quadrics() {
    quadrics_.assign(v_.size(), {});
    for (const auto& [a, b, c] : triangles_) {
      const Quadric plane = Quadric::of_plane(cross(way(a, b), way(a, c)));
      for (const std::uint32_t x : {a, b, c}) quadrics_[x] = quadrics_[x] + plane;
    }
  }

  // At least that of both at one of their places.
  float cost(std::uint32_t a, std::uint32_t b) const {
    const Vecf d = way(a, b);
    const float at_b = quadrics_[a].at(d) + quadrics_[b].c;
    return stays(b) ? at_b : std::min(at_b, quadrics_[b].at(d * -1.0F) + quadrics_[a].c);
  }

  int bucket_of(float cost, float weight) const {
    const double distance = std::sqrt(cost / (weight + 1e-20F)) / reach_;
    return static_cast<int>(std::min<double>(kBuckets, distance * (kBuckets / kLargestCost)));
  }

  void put(std::uint32_t a, int bucket) {
    if (bucket >= kBuckets || (bucket_[a] >= 0 && bucket_[a] <= bucket)) return;
    bucket_[a] = bucket;
    queue_[bucket].push_back(a);
  }

  void push(std::uint32_t a, int at_least) {
    if (stays(a) || corner_[a] == kNone) return;
    float best = 1e30F;
    std::uint32_t c = corner_[a];
    do {
      best = std::min(best, cost(a, at(next(c))));
      c = turn(c);
    } while (c != corner_[a]);
    put(a, std::max(at_least, bucket_of(best, quadrics_[a].weight)));
  }

  // Where only that edge is new.
  void push_edge(std::uint32_t a, std::uint32_t b, int at_least) {
    if (stays(a) || corner_[a] == kNone) return;
    put(a, std::max(at_least, bucket_of(cost(a, b), quadrics_[a].weight)));
  }

  void try_vertex(std::uint32_t a, int bucket) {
    ring_.clear();
    star_.clear();
    std::uint32_t c = corner_[a];
    do {
      ring_.push_back(at(next(c)));
      star_.push_back(c);
      c = turn(c);
    } while (c != corner_[a] && star_.size() < kMostNeighbours);
    const std::size_t n = ring_.size();
    if (n >= kMostNeighbours || n < 3) return;
    std::array<std::pair<float, std::size_t>, kMostNeighbours> order;
    for (std::size_t k = 0; k < n; ++k) order[k] = {cost(a, ring_[k]), k};
    const std::size_t tries = std::min(kTries, n);
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(tries),
                      order.begin() + static_cast<std::ptrdiff_t>(n));
    for (std::size_t k = 0; k < tries; ++k) {
      if (bucket_of(order[k].first, quadrics_[a].weight) >= kBuckets) return;
      if (keeps_topology(order[k].second) && collapse(a, order[k].second, bucket)) return;
    }
  }

  template <class Visit>
  void visit_neighbours(std::uint32_t a, Visit visit) {
    std::uint32_t c = corner_[a];
    do {
      visit(at(next(c)));
      c = turn(c);
    } while (c != corner_[a]);
  }

  // The link condition: no new edge may exist already, and none may join two vertices of the
  // block's boundary.
  bool keeps_topology(std::size_t k) {
    const std::size_t n = ring_.size();
    if (n == 3) return false;
    const std::uint32_t b = ring_[k];
    const std::uint32_t before = ring_[(k + n - 1) % n];
    const std::uint32_t after = ring_[(k + 1) % n];
    const auto is_other = [&](std::uint32_t x) { return x != b && x != before && x != after; };
    bool joins = false;
    if (is_seam_[b] == 0) {
      int degree = 0;
      visit_neighbours(b, [&](std::uint32_t x) {
        ++degree;
        joins = joins || (is_other(x) && std::ranges::find(ring_, x) != ring_.end());
      });
      return !joins && degree > 3;
    }
    for (const std::uint32_t r : ring_) {
      if (!is_other(r)) continue;
      if (is_seam_[r] != 0) return false;
      visit_neighbours(r, [&](std::uint32_t x) { joins = joins || x == b; });
    }
    return !joins;
  }

  bool collapse(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = ring_[k];
    // Caps stay in the faces of the volume, and their edges in both.
    if ((block_.planes[a] & ~block_.planes[b]) != 0) return false;
    if (stays(b) || block_.planes[a] != block_.planes[b]) return to_end(a, k, bucket);
    if (bucket < kEasy) return to_end(a, k, bucket) || to_best(a, k, bucket);
    return to_best(a, k, bucket) || to_end(a, k, bucket);
  }

  // a to ring_[k], which stays where it is.
  bool to_end(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = ring_[k];
    loop_.clear();
    for (std::size_t j = 1; j < ring_.size(); ++j) loop_.push_back(ring_[(k + j) % ring_.size()]);
    is_closed_ = false;
    if (!is_shapely(v_[b], block_.planes[b]) || !is_clear(v_[b])) return false;
    finish(a, k, bucket, quadrics_[a] + quadrics_[b].about(way(b, a)), v_[b].p);
    return true;
  }

  // Both to where their quadric is least, and from there a little away from a side that fails.
  bool to_best(std::uint32_t a, std::size_t k, int bucket) {
    const std::uint32_t b = ring_[k];
    if (!make_loop_around(a, k)) return false;
    is_closed_ = true;
    Vecf normal;
    for (std::size_t i = 1; i + 1 < loop_.size(); ++i) {
      normal = normal + cross(way(loop_[0], loop_[i]), way(loop_[0], loop_[i + 1]));
    }
    const float size = length(normal) * metric_.turn();
    if (!(std::abs(size) > 1e-12F)) return false;
    const Vecf reach = normal * (reach_ / size);
    const Vecf half = way(a, b) * 0.5F;
    const Quadric both = quadrics_[a] + quadrics_[b].about(half * -2.0F);
    const Vecf best = half + both.about(half).least(3 * length(half));
    Vertex x = place(a, best, reach);
    if (!is_within(x.p, a) || !is_shapely(x, block_.planes[a])) return false;
    const Verdict verdict = judge(x);
    if (!verdict.is_clear) {
      if (!verdict.failed) return false;
      x = place(a, best + reach * (*verdict.failed == Side::kIn ? kShift : -kShift), reach);
      if (!is_within(x.p, a) || !is_shapely(x, block_.planes[a]) || !is_clear(x)) return false;
    }
    const Vecf p = x.p;
    v_[b] = x;
    finish(a, k, bucket, both, p);
    return true;
  }

  // What is around a and ring_[k] together.
  bool make_loop_around(std::uint32_t a, std::size_t k) {
    const std::uint32_t b = ring_[k];
    loop_.clear();
    for (std::size_t j = 1; j < ring_.size(); ++j) loop_.push_back(ring_[(k + j) % ring_.size()]);
    std::uint32_t c = corner_[b];
    while (at(next(c)) != a) c = turn(c);
    const std::uint32_t begin = c;
    std::size_t count = 0;
    around_.clear();
    do {
      if (++count > kMostNeighbours) return false;
      around_.push_back(at(next(c)));
      c = turn(c);
    } while (c != begin);
    for (std::size_t j = 2; j + 1 < around_.size(); ++j) loop_.push_back(around_[j]);
    return true;
  }

  Vertex place(std::uint32_t a, Vecf way_mm, Vecf reach_mm) const {
    Vecf p = snap(wide(v_[a].p) + metric_.steps(wide(way_mm)));
    const unsigned planes = block_.planes[a];
    if ((planes & 0b000011) != 0) p.x = v_[a].p.x;
    if ((planes & 0b001100) != 0) p.y = v_[a].p.y;
    if ((planes & 0b110000) != 0) p.z = v_[a].p.z;
    const Vecd reach = metric_.steps(wide(reach_mm));
    return {p, snap(wide(p) + reach), snap(wide(p) - reach)};
  }

  // Beside caps a surface stays on their inner side, or it would cross them.
  bool is_within(Vecf p, std::uint32_t a) const {
    return field_.margin == 0 || block_.planes[a] != 0 || field_.encloses(p);
  }

  // The new triangles are x and two that follow each other in loop_; the last and the first too
  // where it is closed.
  std::size_t new_triangles() const { return loop_.size() - (is_closed_ ? 0 : 1); }
  std::uint32_t after(std::size_t i) const { return loop_[i + 1 < loop_.size() ? i + 1 : 0]; }

  // `planes`: of x.
  bool is_shapely(const Vertex& x, unsigned planes) const {
    for (std::size_t i = 0; i < new_triangles(); ++i) {
      const Vertex& a = v_[loop_[i]];
      const Vertex& b = v_[after(i)];
      const Vecf e = metric_.mm(a.p - x.p);
      const Vecf f = metric_.mm(b.p - x.p);
      const Vecf g = f - e;
      const float longest = std::max({dot(e, e), dot(f, f), dot(g, g)});
      if (!(length(cross(e, f)) >= kLeastShape * longest)) return false;
      if (is_wide(x.in, a.in) || is_wide(x.out, a.out) || is_wide(x.in, b.in) ||
          is_wide(x.out, b.out) ||
          !is_upright(x, a, b, planes & block_.planes[loop_[i]] & block_.planes[after(i)])) {
        return false;
      }
    }
    return true;
  }

  // The star of x in T+ or T-: x and the edges first, which most often tell.
  bool has_clear_edges(Vecf x, Side side) {
    if (!clear_.contains(x)) return false;
    const double sign = side == Side::kIn ? 1 : -1;
    clear_.base(x);
    Star& star = stars_[side == Side::kIn ? 0 : 1];
    star.center = clear_.at(x);
    if (is_closed_ && !clear_.point(star.center, sign)) return false;
    for (std::size_t i = 0; i < loop_.size(); ++i) {
      star.rim[i] = clear_.at(side == Side::kIn ? v_[loop_[i]].in : v_[loop_[i]].out);
    }
    const std::size_t open = is_closed_ ? 0 : 1;
    for (std::size_t i = open; i + open < loop_.size(); ++i) {
      if (!clear_.edge(star.center, star.rim[i], sign)) return false;
    }
    return true;
  }

  bool has_clear_triangles(Vecf x, Side side) {
    clear_.base(x);
    const Star& star = stars_[side == Side::kIn ? 0 : 1];
    for (std::size_t i = 0; i < new_triangles(); ++i) {
      const PlaneNumbers& b = star.rim[i + 1 < loop_.size() ? i + 1 : 0];
      if (!clear_.inside(star.center, star.rim[i], b, side == Side::kIn ? 1 : -1)) return false;
    }
    return true;
  }

  bool is_clear(const Vertex& x) {
    return has_clear_edges(x.in, Side::kIn) && has_clear_edges(x.out, Side::kOut) &&
           has_clear_triangles(x.in, Side::kIn) && has_clear_triangles(x.out, Side::kOut);
  }

  Verdict judge(const Vertex& x) {
    if (!clear_.contains(x.in) || !clear_.contains(x.out)) return {};
    std::array<double, 2> failed = {0, 0};
    bool in = has_clear_edges(x.in, Side::kIn);
    if (!in) failed[0] = clear_.failed();
    bool out = has_clear_edges(x.out, Side::kOut);
    if (!out) failed[1] = clear_.failed();
    if (!in && !out) return {};
    if (in && !has_clear_triangles(x.in, Side::kIn)) {
      in = false;
      failed[0] = clear_.failed();
    }
    if (out && !has_clear_triangles(x.out, Side::kOut)) {
      out = false;
      failed[1] = clear_.failed();
    }
    if (in && out) return {.is_clear = true, .failed = {}};
    if (!in && !out) return {};
    const double most = kShift * 0.5 * (value_at(x.in, 0) - value_at(x.out, 1));
    if (-std::min(failed[0], failed[1]) > most) return {};
    return {.is_clear = false, .failed = in ? Side::kOut : Side::kIn};
  }

  double value_at(Vecf x, std::size_t side) {
    clear_.base(x);
    return clear_.value(stars_[side].center);
  }

  // Gives a's triangles to ring_[k]; `quadric` is about a's place, `p` the new one of ring_[k].
  void finish(std::uint32_t a, std::size_t k, int bucket, const Quadric& quadric, Vecf p) {
    const std::size_t n = ring_.size();
    const std::uint32_t b = ring_[k];
    quadrics_[b] = quadric.about(metric_.mm(p - v_[a].p));
    const std::uint32_t first = star_[k];               // of the triangle a, b, after
    const std::uint32_t last = star_[(k + n - 1) % n];  // of the triangle a, before, b
    join(opposite_[first], opposite_[next(first)]);
    join(opposite_[last], opposite_[previous(last)]);
    for (const std::uint32_t c : star_) at(c) = b;
    triangles_[first / 3] = triangles_[last / 3] = {kNone, kNone, kNone};
    alive_ -= 2;
    corner_[a] = kNone;
    bucket_[a] = -1;
    corner_[b] = star_[(k + 1) % n];
    corner_[ring_[(k + 1) % n]] = next(star_[(k + 1) % n]);
    corner_[ring_[(k + n - 1) % n]] = previous(star_[(k + n - 2) % n]);
    bucket_[b] = -1;
    push(b, bucket);
    for (const std::uint32_t r : ring_) {
      if (r != b) push_edge(r, b, bucket);
    }
  }

  void join(std::uint32_t c, std::uint32_t d) {
    if (c != kNone) opposite_[c] = d;
    if (d != kNone) opposite_[d] = c;
  }

  struct Star {
    PlaneNumbers center;
    std::array<PlaneNumbers, 2 * kMostNeighbours> rim;
  };

  const Field& field_;
  const Metric& metric_;
  const float reach_;
  Block& block_;
  Clear clear_;
  std::vector<Vertex>& v_;
  std::vector<Triangle>& triangles_;
  std::size_t alive_;
  std::vector<std::uint32_t> opposite_;  // by corner: that beyond the edge opposite
  std::vector<std::uint32_t> corner_;    // by vertex: one of its corners
  std::vector<std::uint8_t> is_seam_;    // by vertex: on the block's boundary
  std::vector<Quadric> quadrics_;
  std::vector<int> bucket_;
  std::array<std::vector<std::uint32_t>, kBuckets> queue_;
  std::vector<std::uint32_t> ring_, star_, loop_, around_;
  bool is_closed_ = false;
  std::array<Star, 2> stars_;
};

}  // namespace

void collapse_block(const Field& field, const Metric& metric, double reach_mm, std::size_t least,
                    Block& block) {
  Collapser(field, metric, reach_mm, block).run(least);
}

}  // namespace isomesh::mesh::bound
