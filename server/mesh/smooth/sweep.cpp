#include "server/mesh/smooth/sweep.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "server/mesh/buffer.h"

namespace isomesh::mesh {
namespace {

// A step reads three layers of the step before, and the one that it completes takes the place of
// the first of them.
constexpr std::size_t kRingLayers = 3;

// Where a position lies in every ring, in units of 8 bytes: what a processor scales by itself.
using Place = std::uint32_t;
constexpr Place kPlacesPerPosition = sizeof(Float4) / 8;

Float4 at(const Float4* ring, Place place) {
  return *reinterpret_cast<const Float4*>(reinterpret_cast<const char*>(ring) +
                                          std::size_t{place} * 8);
}

// One more neighbour of a vertex that has many.
struct MoreNeighbor {
  std::uint32_t vertex = 0;  // counted from the layer's first
  Place place = 0;
};

constexpr std::uint32_t kNoVertex = UINT32_MAX;  // ends a list

// A vertex and its neighbours, as the triangles around it name them one after the other.
class Neighbors {
 public:
  explicit Neighbors(Place of_zero) { neighbors_.fill(of_zero); }

  // A triangle's next and previous corner. False when there is no place left for the neighbour.
  bool add(std::uint32_t next, std::uint32_t previous, Place next_place) {
    const auto count = static_cast<std::size_t>(fan_ & (kOne - 1));
    fan_ += (std::int64_t{next} - previous) * kOne + 1;
    if (count >= kUsualNeighbors) return false;
    neighbors_[count] = next_place;
    return true;
  }

  // The two neighbours along a line where walls meet.
  void set_line(Place one, Place other) {
    neighbors_[0] = one;
    neighbors_[1] = other;
    fan_ = 2;
  }

  // True for a vertex on a line.
  bool has_line() const { return fan_ == 2; }

  // In an oriented manifold the triangles name each neighbour once as the next corner and once as
  // the previous one, and the sum of the differences is zero, unless the vertex lies on the
  // boundary: then its first neighbour is never a next one and its last never a previous one.
  bool is_on_boundary() const { return fan_ <= 0 || fan_ >= kOne; }
  float one_over_count() const { return 1 / static_cast<float>(fan_); }

  // What makes a mean of the sum of the neighbours; 0 for a vertex that is to stay where it is.
  void set_weight(float weight) { weight_ = weight; }
  float weight() const { return weight_; }

  // The first neighbours, and then the place of zero.
  const std::array<Place, kUsualNeighbors>& neighbors() const { return neighbors_; }

 private:
  static constexpr std::int64_t kOne = 1 << 16;
  union {
    std::int64_t fan_ = 0;  // 2^16 times the sum of next minus previous corners, plus their number
    float weight_;          // once that is known
  };
  std::array<Place, kUsualNeighbors> neighbors_;
};

// A layer's vertices while their neighbours are listed.
struct LayerLinks {
  std::uint32_t first = 0;      // vertex
  Place first_place = 0;        // in every ring
  std::size_t first_index = 0;  // in the array of links
  std::vector<MoreNeighbor>* more = nullptr;
  std::vector<MoreNeighbor>* on_line = nullptr;  // of vertices on lines, once for each triangle
};

// Lists, for the vertices of two layers, the corners that follow them in the triangles that name
// both layers' vertices; for those on a line where walls meet, `is_on_line`, the corners that are
// on it too, whichever side they are of. The differences below are modulo 2^32 and 2^64.
template <bool kHasLines, class IsOnLine>
void add_neighbors(std::span<const Triangle> triangles, const LayerLinks& lower,
                   const LayerLinks& upper, IsOnLine is_on_line, Neighbors* links) {
  const Place upper_shift = upper.first_place - upper.first * kPlacesPerPosition;
  const Place lower_shift = lower.first_place - lower.first * kPlacesPerPosition;
  const auto place_of = [&](std::uint32_t vertex) {
    return vertex * kPlacesPerPosition + (vertex >= upper.first ? upper_shift : lower_shift);
  };
  const auto add = [&](std::uint32_t vertex, std::uint32_t next, std::uint32_t previous,
                       Place next_place) {
    const bool is_upper = vertex >= upper.first;
    const std::size_t index =
        vertex + (is_upper ? upper.first_index - upper.first : lower.first_index - lower.first);
    if constexpr (kHasLines) {
      if (is_on_line(vertex)) {
        for (const std::uint32_t other : {next, previous}) {
          if (!is_on_line(other)) continue;
          const LayerLinks& layer = is_upper ? upper : lower;
          layer.on_line->push_back({vertex - layer.first, place_of(other)});
        }
        return;
      }
    }
    if (links[index].add(next, previous, next_place)) return;
    const LayerLinks& layer = is_upper ? upper : lower;
    layer.more->push_back({vertex - layer.first, next_place});
  };
  for (const auto& [a, b, c] : triangles) {
    const Place place_a = place_of(a);
    add(a, b, c, place_of(b));
    add(b, c, a, place_of(c));
    add(c, a, b, place_a);
  }
}

float length_of(Float4 lanes) {
  const Float4 squares = lanes * lanes;
  return std::sqrt(squares[0] + squares[1] + squares[2]);
}

double distance(const Vec3& a, const Vec3& b) {
  const double x = double{a[0]} - b[0];
  const double y = double{a[1]} - b[1];
  const double z = double{a[2]} - b[2];
  return std::sqrt(x * x + y * y + z * z);
}

// The point on the way from `origin` to `position` that is `limit` away from it. Rounded towards
// the origin in each coordinate, so that it is not farther by a rounding error.
Float4 pulled_back(const Vec3& origin, Float4 position, double limit) {
  std::array<double, 3> way;
  double squares = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    way[axis] = double{position[axis]} - origin[axis];
    squares += way[axis] * way[axis];
  }
  const double length = std::sqrt(squares);
  if (length <= limit) return position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double goal = origin[axis] + way[axis] * (limit / length);
    auto nearest = static_cast<float>(goal);
    if (std::abs(nearest - double{origin[axis]}) > std::abs(goal - origin[axis])) {
      nearest = std::nextafter(nearest, origin[axis]);
    }
    position[axis] = nearest;
  }
  return position;
}

class Sweep {
 public:
  Sweep(const Round& round, const LayerRange& slab, const LayerCopy& below, const LayerCopy& above,
        const std::function<void()>& on_layer)
      : round_(round),
        slab_(slab),
        below_(below),
        above_(above),
        on_layer_(on_layer),
        steps_(round.steps()) {
    const LayerRange all = covered(0);
    for (std::ptrdiff_t layer = all.begin; layer < all.end; ++layer) {
      width_ = std::max(width_, vertices(layer));
    }
    for (std::size_t step = 0; step < steps_; ++step) {
      rings_.emplace_back().resize_for_overwrite(kRingLayers * width_ + 1);
      rings_.back()[kRingLayers * width_] = Float4{};  // for places of no neighbour
    }
    moved_.resize_for_overwrite(width_);
    links_.resize((steps_ + 1) * width_, Neighbors(place_of_zero()));
    more_.resize(steps_ + 1);
    on_line_.resize(steps_ + 1);
  }

  void run() {
    const std::ptrdiff_t bottom = covered(0).begin;
    const auto last_step = static_cast<std::ptrdiff_t>(steps_);
    read(bottom);
    begin_links(bottom);
    for (std::ptrdiff_t front = bottom; front < slab_.end + last_step - 1; ++front) {
      read(front + 1);
      link(front);
      for (std::ptrdiff_t step = 1; step <= last_step; ++step) {
        const std::ptrdiff_t layer = front - (step - 1);
        advance(static_cast<std::size_t>(step), layer);
      }
    }
  }

 private:
  // The layers that a step moves; those of step 0 are what the first one starts from.
  LayerRange covered(std::size_t step) const { return with_halo(round_, slab_, steps_ - step); }

  std::size_t vertices(std::ptrdiff_t layer) const {
    return round_.first_vertex(layer + 1) - round_.first_vertex(layer);
  }

  static std::size_t turn(std::ptrdiff_t layer, std::size_t period) {
    return static_cast<std::size_t>(layer) % period;
  }
  Float4* positions(std::size_t step, std::ptrdiff_t layer) {
    return rings_[step].data() + turn(layer, kRingLayers) * width_;
  }
  Neighbors* links(std::ptrdiff_t layer) {
    return links_.data() + turn(layer, steps_ + 1) * width_;
  }
  std::vector<MoreNeighbor>& more_neighbors(std::ptrdiff_t layer) {
    return more_[turn(layer, steps_ + 1)];
  }
  LayerLinks layer_links(std::ptrdiff_t layer) {
    return {
        .first = static_cast<std::uint32_t>(round_.first_vertex(layer)),
        .first_place = static_cast<Place>(turn(layer, kRingLayers) * width_ * kPlacesPerPosition),
        .first_index = static_cast<std::size_t>(links(layer) - links_.data()),
        .more = &more_neighbors(layer),
        .on_line = &on_line_[turn(layer, steps_ + 1)]};
  }
  Place place_of_zero() const {
    return static_cast<Place>(kRingLayers * width_ * kPlacesPerPosition);
  }

  // Where the layer's vertices are before the round. For the slab's own until their last step.
  const Vec3* unmoved(std::ptrdiff_t layer) const {
    const std::uint64_t first = round_.first_vertex(layer);
    if (slab_.contains(layer)) return round_.mesh.positions.data() + first;
    const LayerCopy& copy = layer < slab_.begin ? below_ : above_;
    return copy.positions.data() + (first - round_.first_vertex(copy.layers.begin));
  }

  const Vec3* extracted(std::ptrdiff_t layer) const {
    return round_.extracted != nullptr ? round_.extracted + round_.first_vertex(layer)
                                       : unmoved(layer);
  }

  void read(std::ptrdiff_t layer) {
    if (!covered(0).contains(layer)) return;
    const Vec3* from = unmoved(layer);
    Float4* to = positions(0, layer);
    const std::size_t count = vertices(layer);
    for (std::size_t v = 0; v < count; ++v) {
      to[v] = Float4{from[v][0], from[v][1], from[v][2], 0};
    }
    if (round_.before == nullptr || !slab_.contains(layer)) return;
    for (std::size_t v = 0; v < count; ++v) round_.before[layer].add_vertex(to[v]);
    measure(layer, round_.before);
  }

  // Measures the slab's triangles whose vertices are all there once the layer's are.
  void measure(std::ptrdiff_t layer, LayerExtent* extents) {
    if (slab_.contains(layer - 1)) add_triangles(round_.mesh, layer - 1, extents[layer - 1]);
    if (layer + 1 == round_.layers()) add_triangles(round_.mesh, layer, extents[layer]);
  }

  void begin_links(std::ptrdiff_t layer) {
    std::fill_n(links(layer), vertices(layer), Neighbors(place_of_zero()));
    more_neighbors(layer).clear();
    on_line_[turn(layer, steps_ + 1)].clear();
  }

  // Adds the layer's triangles to the lists of neighbours; those of its vertices are complete then.
  void link(std::ptrdiff_t layer) {
    if (layer >= covered(1).end) return;
    const bool is_last = layer + 1 == round_.layers();
    LayerLinks upper = {.first = static_cast<std::uint32_t>(round_.first_vertex(layer + 1))};
    if (!is_last) {
      begin_links(layer + 1);
      upper = layer_links(layer + 1);
    }
    const auto triangles = round_.mesh.triangles_of(layer, layer + 1);
    const auto is_on_line = [&](std::uint32_t v) { return round_.mesh.is_on_line(v); };
    if (round_.mesh.on_line.empty()) {
      add_neighbors<false>(triangles, layer_links(layer), upper, is_on_line, links_.data());
    } else {
      add_neighbors<true>(triangles, layer_links(layer), upper, is_on_line, links_.data());
    }
    weigh(layer);
    auto& more = more_neighbors(layer);
    std::ranges::stable_sort(more, {}, &MoreNeighbor::vertex);
    more.push_back({kNoVertex, 0});
  }

  // Three walls meet along a line, so three triangles name each neighbour along it. Two name one
  // across a wall. Sets the neighbours of vertices that have two along lines; where a line ends or
  // lines meet there are not two.
  void find_lines(std::ptrdiff_t layer) {
    auto& found = on_line_[turn(layer, steps_ + 1)];
    const auto key = [](const MoreNeighbor& n) { return std::pair(n.vertex, n.place); };
    std::ranges::sort(found, {}, key);
    for (std::size_t i = 0; i < found.size();) {
      const std::uint32_t vertex = found[i].vertex;
      std::array<Place, 2> along = {};
      std::size_t count = 0;
      while (i < found.size() && found[i].vertex == vertex) {
        const std::size_t begin = i;
        while (i < found.size() && key(found[i]) == key(found[begin])) ++i;
        if (i - begin < 3) continue;
        if (count < along.size()) along[count] = found[begin].place;
        ++count;
      }
      if (count == along.size()) links(layer)[vertex].set_line(along[0], along[1]);
    }
  }

  // Decides which of the layer's vertices stay where they are.
  void weigh(std::ptrdiff_t layer) {
    find_lines(layer);
    Neighbors* link = links(layer);
    const std::uint64_t first = round_.first_vertex(layer);
    const std::size_t count = vertices(layer);
    for (std::size_t v = 0; v < count; ++v) {
      const bool is_held =
          round_.mesh.is_on_line(first + v) ? !link[v].has_line() : link[v].is_on_boundary();
      const bool is_fixed = is_held || round_.mesh.is_on_border(first + v);
      link[v].set_weight(is_fixed ? 0 : link[v].one_over_count());
    }
  }

  void advance(std::size_t step, std::ptrdiff_t layer) {
    if (!covered(step).contains(layer)) return;
    const bool is_last = step == steps_;
    Float4* to = is_last ? moved_.data() : positions(step, layer);
    move(step, layer, to);
    if (!round_.within.empty()) hold_within(layer, to);
    if (std::isfinite(round_.max_displacement_mm)) pull_back(layer, to);
    if (!is_last) return;
    finish(layer);
    on_layer_();
  }

  void move(std::size_t step, std::ptrdiff_t layer, Float4* to) {
    const float share = round_.shares[step - 1];
    const Neighbors* link = links(layer);
    const MoreNeighbor* more = more_neighbors(layer).data();
    const Float4* ring = rings_[step - 1].data();
    const Float4* from = positions(step - 1, layer);
    const std::size_t count = vertices(layer);
    for (std::size_t v = 0; v < count; ++v) {
      Float4 sum = {};
      for (const Place place : link[v].neighbors()) sum += at(ring, place);
      for (; more->vertex == v; ++more) sum += at(ring, more->place);
      const Float4 mean = sum * link[v].weight();
      const Float4 moved = share == 1 ? mean : from[v] + (mean - from[v]) * share;
      to[v] = link[v].weight() == 0 ? from[v] : moved;
    }
  }

  void hold_within(std::ptrdiff_t layer, Float4* to) {
    const Neighbors* link = links(layer);
    const std::size_t count = vertices(layer);
    for (std::size_t v = 0; v < count; ++v) {
      if (link[v].weight() == 0) continue;
      for (const HalfSpace& half : round_.within) {
        const double outside = half.normal[0] * to[v][0] + half.normal[1] * to[v][1] +
                               half.normal[2] * to[v][2] - half.offset;
        if (outside <= 0) continue;
        for (int axis = 0; axis < 3; ++axis) {
          to[v][axis] = static_cast<float>(to[v][axis] - outside * half.normal[axis]);
        }
      }
    }
  }

  void pull_back(std::ptrdiff_t layer, Float4* to) const {
    const double limit = round_.max_displacement_mm;
    const auto surely_within = static_cast<float>(limit * 0.999);
    const Vec3* origin = extracted(layer);
    const std::size_t count = vertices(layer);
    for (std::size_t v = 0; v < count; ++v) {
      const Float4 from = {origin[v][0], origin[v][1], origin[v][2], 0};
      if (length_of(to[v] - from) > surely_within) to[v] = pulled_back(origin[v], to[v], limit);
    }
  }

  // Writes the layer's last positions of the round, and measures them if it is the last round.
  void finish(std::ptrdiff_t layer) {
    const std::size_t count = vertices(layer);
    const Vec3* origin = extracted(layer);  // may be `to`: read before written
    Vec3* to = round_.mesh.positions.data() + round_.first_vertex(layer);
    LayerDisplacement displacement;
    LayerExtent* extent = round_.after == nullptr ? nullptr : &round_.after[layer];
    for (std::size_t v = 0; v < count; ++v) {
      const Float4 moved = moved_[v];
      const Vec3 position = {moved[0], moved[1], moved[2]};
      if (extent != nullptr) {
        extent->add_vertex(moved);
        const double way = distance(position, origin[v]);
        displacement.sum += way;
        displacement.largest = std::max(displacement.largest, way);
      }
      to[v] = position;
    }
    if (extent == nullptr) return;
    round_.displacements[layer] = displacement;
    measure(layer, round_.after);
  }

  const Round& round_;
  const LayerRange slab_;
  const LayerCopy& below_;
  const LayerCopy& above_;
  const std::function<void()>& on_layer_;
  const std::size_t steps_;
  std::size_t width_ = 0;              // the vertices of the largest layer
  std::vector<Buffer<Float4>> rings_;  // positions before each step
  Buffer<Float4> moved_;               // the positions of one layer after the last step
  std::vector<Neighbors> links_;
  std::vector<std::vector<MoreNeighbor>> more_;  // in the order of the vertices
  std::vector<std::vector<MoreNeighbor>> on_line_;
};

}  // namespace

LayerRange with_halo(const Round& round, const LayerRange& slab, std::size_t steps) {
  const auto halo = static_cast<std::ptrdiff_t>(steps);
  return {std::max<std::ptrdiff_t>(0, slab.begin - halo),
          std::min(round.layers(), slab.end + halo)};
}

void sweep(const Round& round, const LayerRange& slab, const LayerCopy& below,
           const LayerCopy& above, const std::function<void()>& on_layer) {
  Sweep(round, slab, below, above, on_layer).run();
}

std::uint64_t sweep_bytes_per_vertex(std::size_t steps) {
  return (kRingLayers * steps + 1) * sizeof(Float4) + (steps + 1) * sizeof(Neighbors);
}

}  // namespace isomesh::mesh
