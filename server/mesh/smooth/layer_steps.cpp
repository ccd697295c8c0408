#include "server/mesh/smooth/layer_steps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/flat_triangles.h"

namespace isomesh::mesh {
namespace {

// A step reads three layers of the previous step. The layer that it completes replaces the first of
// them.
constexpr std::size_t kRingLayers = 3;
// The layers whose triangles are being listed.
constexpr std::size_t kLayersOfFans = 2;
// The layers that a triangle names.
constexpr std::size_t kLayersOfTriangles = 2;

// The place of a position in every ring, in units of 8 bytes, which processors scale by themselves.
using Place = std::uint32_t;
constexpr Place kPlacesPerPosition = sizeof(Float4) / 8;

Float4 at(const Float4* ring, Place place) {
  return *reinterpret_cast<const Float4*>(reinterpret_cast<const char*>(ring) +
                                          std::size_t{place} * 8);
}

// A further neighbour of a vertex that has many.
struct MoreNeighbor {
  std::uint32_t vertex = 0;  // relative to the layer's first
  Place place = 0;
};

constexpr std::uint32_t kNoVertex = UINT32_MAX;  // ends a list

// A vertex's neighbours, in the order in which its triangles name them.
struct Neighbors {
  // Turns the sum of the neighbours into their mean; 0 for a vertex that stays where it is.
  float weight = 0;
  // The first neighbours, then the place of zero.
  std::array<Place, kUsualNeighbors> places;

  explicit Neighbors(Place of_zero) { places.fill(of_zero); }
};

// The triangles around a vertex, while they are listed.
class Fan {
 public:
  // Adds a triangle by its next and its previous corner. Returns the number of triangles before.
  std::size_t add(std::uint32_t next, std::uint32_t previous) {
    const auto count = static_cast<std::size_t>(sum_ & (kOne - 1));
    sum_ += (std::int64_t{next} - previous) * kOne + 1;
    return count;
  }

  // In an oriented manifold the triangles name each neighbour once as the next corner and once as
  // the previous one, and the sum of the differences is zero, unless the vertex lies on the
  // boundary: then its first neighbour is never a next one and its last never a previous one.
  bool is_on_boundary() const { return sum_ <= 0 || sum_ >= kOne; }
  float one_over_count() const { return 1 / static_cast<float>(sum_); }

 private:
  static constexpr std::int64_t kOne = 1 << 16;
  std::int64_t sum_ = 0;  // 2^16 times the sum of next minus previous corners, plus their number
};

// A layer's vertices while their neighbours are listed.
struct LayerLinks {
  std::uint32_t first = 0;  // vertex
  Place first_place = 0;    // in every ring
  Neighbors* neighbors = nullptr;
  Fan* fans = nullptr;
  std::vector<MoreNeighbor>* more = nullptr;
  // Neighbours along junction curves, of vertices on them, once for each triangle.
  std::vector<MoreNeighbor>* on_line = nullptr;
};

// Lists, for the vertices of two layers, the corners that follow them in the triangles that name
// both layers' vertices. For vertices on a junction curve, `is_on_line`, it lists all corners on
// the curve instead. The differences below are modulo 2^32.
template <bool kHasLines, class IsOnLine>
void add_neighbors(std::span<const Triangle> triangles, const LayerLinks& lower,
                   const LayerLinks& upper, IsOnLine is_on_line) {
  const Place upper_shift = upper.first_place - upper.first * kPlacesPerPosition;
  const Place lower_shift = lower.first_place - lower.first * kPlacesPerPosition;
  const auto place_of = [&](std::uint32_t vertex) {
    return vertex * kPlacesPerPosition + (vertex >= upper.first ? upper_shift : lower_shift);
  };
  const auto add = [&](std::uint32_t vertex, std::uint32_t next, std::uint32_t previous,
                       Place next_place) {
    const LayerLinks& layer = vertex >= upper.first ? upper : lower;
    const std::uint32_t index = vertex - layer.first;
    if constexpr (kHasLines) {
      if (is_on_line(vertex)) {
        for (const std::uint32_t other : {next, previous}) {
          if (is_on_line(other)) layer.on_line->push_back({index, place_of(other)});
        }
        return;
      }
    }
    const std::size_t count = layer.fans[index].add(next, previous);
    if (count < kUsualNeighbors) {
      layer.neighbors[index].places[count] = next_place;
    } else {
      layer.more->push_back({index, next_place});
    }
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

// The layers that are moved by all but so many steps, for a run to be right.
LayerRange around_run(const LayerRange& run, std::size_t steps, std::ptrdiff_t layers) {
  const auto begin = run.begin - static_cast<std::ptrdiff_t>(kBelowRun + steps);
  const auto end = run.end + static_cast<std::ptrdiff_t>(kAboveRun + steps);
  return {std::max<std::ptrdiff_t>(0, begin), std::min(layers, end)};
}

}  // namespace

class LayerSteps::Sweep {
 public:
  Sweep(const Round& round, const LayerRange& run, SmoothedLayers layers)
      : round_(round),
        run_(run),
        layers_(std::move(layers)),
        steps_(round.steps()),
        width_(round.largest_layer) {
    for (std::size_t step = 0; step < std::max<std::size_t>(1, steps_); ++step) {
      rings_.emplace_back().resize_for_overwrite(kRingLayers * width_ + 1);
      rings_.back()[kRingLayers * width_] = Float4{};  // for places of no neighbour
    }
    moved_.resize_for_overwrite(width_);
    if (round_.is_last()) kept_.resize_for_overwrite(kLayersOfTriangles * width_);
    links_.resize((steps_ + 1) * width_, Neighbors(place_of_zero()));
    fans_.resize(kLayersOfFans * width_);
    more_.resize(steps_ + 1);
    on_line_.resize(steps_ + 1);
  }

  void go_on(std::ptrdiff_t available) {
    if (available <= 0) return;
    if (!has_begun_) {
      read(0);
      begin_links(0);
      has_begun_ = true;
    }
    const auto last_step = static_cast<std::ptrdiff_t>(steps_);
    const std::ptrdiff_t end =
        available >= layers_.count()
            ? covered(steps_).end + std::max<std::ptrdiff_t>(0, last_step - 1)
            : available - 1;
    for (; front_ < end; ++front_) {
      read(front_ + 1);
      link(front_);
      for (std::ptrdiff_t step = 1; step <= last_step; ++step) {
        advance(static_cast<std::size_t>(step), front_ - (step - 1));
      }
    }
  }

  std::ptrdiff_t moved() const {
    const std::ptrdiff_t behind =
        std::max<std::ptrdiff_t>(0, static_cast<std::ptrdiff_t>(steps_) - 1);
    return std::clamp<std::ptrdiff_t>(front_ - behind, 0, layers_.count());
  }

 private:
  LayerView view(std::ptrdiff_t layer) const { return layers_.view(layer); }

  // The layers that a step moves. Those of step 0 are the ones that the first step reads.
  LayerRange covered(std::size_t step) const {
    return around_run(run_, steps_ - step, layers_.count());
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
  Vec3* kept(std::ptrdiff_t layer) {
    return kept_.data() + turn(layer, kLayersOfTriangles) * width_;
  }
  Fan* fans(std::ptrdiff_t layer) { return fans_.data() + turn(layer, kLayersOfFans) * width_; }
  std::vector<MoreNeighbor>& more_neighbors(std::ptrdiff_t layer) {
    return more_[turn(layer, steps_ + 1)];
  }
  // `first`: the number of the layer's first vertex in the triangles that are listed.
  LayerLinks layer_links(std::ptrdiff_t layer, std::uint64_t first) {
    return {
        .first = static_cast<std::uint32_t>(first),
        .first_place = static_cast<Place>(turn(layer, kRingLayers) * width_ * kPlacesPerPosition),
        .neighbors = links(layer),
        .fans = fans(layer),
        .more = &more_neighbors(layer),
        .on_line = &on_line_[turn(layer, steps_ + 1)]};
  }
  Place place_of_zero() const {
    return static_cast<Place>(kRingLayers * width_ * kPlacesPerPosition);
  }

  void read(std::ptrdiff_t layer) {
    if (layer >= layers_.count()) return;
    const LayerView from = view(layer);
    Float4* to = positions(0, layer);
    const std::size_t count = from.vertices();
    for (std::size_t v = 0; v < count; ++v) to[v] = load(from.positions[v]);
    if (!round_.is_first()) return;
    LayerExtent& before = layers_.result(layer).before;
    for (std::size_t v = 0; v < count; ++v) before.add_vertex(to[v]);
    measure_before(layer - 1);
    if (layer + 1 == layers_.count()) measure_before(layer);
  }

  void measure_before(std::ptrdiff_t layer) {
    if (!run_.contains(layer)) return;
    layers_.add_triangles(layer, &SmoothedLayer::before);
    if (round_.options.steps.empty()) layers_.result(layer).after = layers_.result(layer).before;
  }

  void begin_links(std::ptrdiff_t layer) {
    const std::size_t count = view(layer).vertices();
    std::fill_n(links(layer), count, Neighbors(place_of_zero()));
    std::fill_n(fans(layer), count, Fan());
    more_neighbors(layer).clear();
    on_line_[turn(layer, steps_ + 1)].clear();
  }

  // Adds the layer's triangles to the neighbours of its vertices, which completes them.
  void link(std::ptrdiff_t layer) {
    if (steps_ == 0 || layer >= covered(1).end) return;
    const LayerView own = view(layer);
    LayerLinks upper = {.first = static_cast<std::uint32_t>(own.end())};
    if (layer + 1 < layers_.count()) {
      begin_links(layer + 1);
      upper = layer_links(layer + 1, own.end());
    }
    const LayerLinks lower = layer_links(layer, own.first());
    const auto is_on_line = [&](std::uint32_t v) { return own.mesh->is_on_line(v); };
    if (own.mesh->on_line.empty()) {
      add_neighbors<false>(own.triangles(), lower, upper, is_on_line);
    } else {
      add_neighbors<true>(own.triangles(), lower, upper, is_on_line);
    }
    weigh(layer);
    auto& more = more_neighbors(layer);
    std::ranges::stable_sort(more, {}, &MoreNeighbor::vertex);
    more.push_back({kNoVertex, 0});
  }

  // Lets vertices with two neighbours along a junction curve move between them. Ends and junctions
  // of curves do not have two. Three walls meet along a curve, so three triangles name a neighbour
  // along it; two name one across a wall.
  void free_along_lines(std::ptrdiff_t layer) {
    auto& found = on_line_[turn(layer, steps_ + 1)];
    const LayerView own = view(layer);
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
      if (count != along.size() || own.mesh->is_on_border(own.first() + vertex)) continue;
      Neighbors& link = links(layer)[vertex];
      std::ranges::copy(along, link.places.begin());
      link.weight = 1.0F / along.size();
    }
  }

  // Sets the weights of the layer's neighbours. Vertices on a junction curve have an empty fan.
  void weigh(std::ptrdiff_t layer) {
    Neighbors* link = links(layer);
    const Fan* fan = fans(layer);
    const LayerView own = view(layer);
    const std::size_t count = own.vertices();
    for (std::size_t v = 0; v < count; ++v) {
      const bool is_fixed = fan[v].is_on_boundary() || own.mesh->is_on_border(own.first() + v);
      link[v].weight = is_fixed ? 0 : fan[v].one_over_count();
    }
    if (round_.options.at_curves == AtCurves::kAlong) free_along_lines(layer);
  }

  void advance(std::size_t step, std::ptrdiff_t layer) {
    if (!covered(step).contains(layer)) return;
    const bool is_last = step == steps_;
    Float4* to = is_last ? moved_.data() : positions(step, layer);
    move(step, layer, to);
    if (!round_.options.within.empty()) hold_within(layer, to);
    if (std::isfinite(round_.options.max_displacement_mm)) pull_back(layer, to);
    if (!is_last) return;
    finish(layer);
  }

  void move(std::size_t step, std::ptrdiff_t layer, Float4* to) {
    const auto share = static_cast<float>(round_.options.steps[round_.first + step - 1].weight);
    const Neighbors* link = links(layer);
    const MoreNeighbor* more = more_neighbors(layer).data();
    const Float4* ring = rings_[step - 1].data();
    const Float4* from = positions(step - 1, layer);
    const std::size_t count = view(layer).vertices();
    for (std::size_t v = 0; v < count; ++v) {
      Float4 sum = {};
      for (const Place place : link[v].places) sum += at(ring, place);
      for (; more->vertex == v; ++more) sum += at(ring, more->place);
      const Float4 mean = sum * link[v].weight;
      const Float4 moved = share == 1 ? mean : from[v] + (mean - from[v]) * share;
      to[v] = link[v].weight == 0 ? from[v] : moved;
    }
  }

  void hold_within(std::ptrdiff_t layer, Float4* to) {
    const Neighbors* link = links(layer);
    const std::size_t count = view(layer).vertices();
    for (std::size_t v = 0; v < count; ++v) {
      if (link[v].weight == 0) continue;
      for (const HalfSpace& half : round_.options.within) {
        const double outside = half.normal[0] * to[v][0] + half.normal[1] * to[v][1] +
                               half.normal[2] * to[v][2] - half.offset;
        if (outside <= 0) continue;
        for (int axis = 0; axis < 3; ++axis) {
          to[v][axis] = static_cast<float>(to[v][axis] - outside * half.normal[axis]);
        }
      }
    }
  }

  static const Vec3* extracted(const LayerView& layer) {
    return layer.extracted != nullptr ? layer.extracted : layer.positions;
  }

  void pull_back(std::ptrdiff_t layer, Float4* to) const {
    const double limit = round_.options.max_displacement_mm;
    const auto surely_within = static_cast<float>(limit * 0.999);
    const LayerView own = view(layer);
    const Vec3* origin = extracted(own);
    const std::size_t count = own.vertices();
    for (std::size_t v = 0; v < count; ++v) {
      const Float4 from = {origin[v][0], origin[v][1], origin[v][2], 0};
      if (length_of(to[v] - from) <= surely_within) continue;
      to[v] = load(rounded_within(origin[v], {to[v][0], to[v][1], to[v][2]}, limit));
    }
  }

  // Writes the layer's positions after the round, and measures them in the last round.
  void finish(std::ptrdiff_t layer) {
    const LayerView own = view(layer);
    const std::size_t count = own.vertices();
    const Vec3* origin = extracted(own);  // may be `to`: read before written
    Vec3* to = own.positions;
    LayerDisplacement displacement;
    SmoothedLayer* result = round_.is_last() ? &layers_.result(layer) : nullptr;
    if (result != nullptr) std::copy_n(origin, count, kept(layer));
    for (std::size_t v = 0; v < count; ++v) {
      const Float4 moved = moved_[v];
      const Vec3 position = {moved[0], moved[1], moved[2]};
      if (result != nullptr) {
        result->after.add_vertex(moved);
        displacement.add(origin[v], position);
      }
      to[v] = position;
    }
    if (result == nullptr) return;
    result->displacement = displacement;
    if (layer > covered(steps_).begin) restore(layer - 1);
    if (layer + 1 < layers_.count()) return;
    restore(layer);
    measure_again(layer, &SmoothedLayer::was_put_back, layers_);
  }

  // Measures the layer's triangles, whose vertices have all been moved, and undoes the moves that
  // left them without area.
  void restore(std::ptrdiff_t layer) {
    layers_.add_triangles(layer, &SmoothedLayer::after);
    if (layers_.result(layer).after.has_flat()) list_flat(layer, layers_);
    put_back(kept(layer), layer, layers_);
    if (layer > 0) measure_again(layer - 1, &SmoothedLayer::was_put_back, layers_);
  }

  const Round round_;
  const LayerRange run_;
  const SmoothedLayers layers_;
  const std::size_t steps_;
  const std::size_t width_;   // the vertices of the largest layer
  std::ptrdiff_t front_ = 0;  // the layer whose links come next
  bool has_begun_ = false;
  std::vector<Buffer<Float4>> rings_;  // positions before each step
  Buffer<Float4> moved_;               // the positions of one layer after the last step
  Buffer<Vec3> kept_;                  // extracted positions of layers that have been overwritten
  std::vector<Neighbors> links_;
  std::vector<Fan> fans_;
  std::vector<std::vector<MoreNeighbor>> more_;  // in the order of the vertices
  std::vector<std::vector<MoreNeighbor>> on_line_;
};

LayerSteps::LayerSteps(const Round& round, const LayerRange& run, SmoothedLayers layers)
    : sweep_(std::make_unique<Sweep>(round, run, std::move(layers))) {}
LayerSteps::~LayerSteps() = default;

LayerRange LayerSteps::around(const Round& round, const LayerRange& run, std::ptrdiff_t layers) {
  return around_run(run, round.steps(), layers);
}
void LayerSteps::go_on(std::ptrdiff_t available) { sweep_->go_on(available); }
std::ptrdiff_t LayerSteps::moved() const { return sweep_->moved(); }

Vec3 rounded_within(const Vec3& origin, const Point& goal, double limit) {
  const auto way_to = [&](const Point& point) { return minus(point, to_point(origin)); };
  const auto length_of_way = [](const Point& way) { return std::sqrt(dot(way, way)); };
  Vec3 rounded;
  std::ranges::transform(goal, rounded.begin(), [](double at) { return static_cast<float>(at); });
  if (length_of_way(way_to(to_point(rounded))) <= limit) return rounded;
  const Point way = way_to(goal);
  const double share = std::min(1.0, limit / length_of_way(way));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double nearer = origin[axis] + way[axis] * share;
    rounded[axis] = static_cast<float>(nearer);
    if (std::abs(rounded[axis] - double{origin[axis]}) > std::abs(nearer - origin[axis])) {
      rounded[axis] = std::nextafter(rounded[axis], origin[axis]);
    }
  }
  return rounded;
}

void LayerDisplacement::add(const Vec3& extracted, const Vec3& moved) {
  const Point way = minus(to_point(moved), to_point(extracted));
  const double length = std::sqrt(dot(way, way));
  sum += length;
  largest = std::max(largest, length);
}

void SmoothedLayers::add_triangles(std::ptrdiff_t layer, LayerExtent SmoothedLayer::*extent) const {
  const LayerView low = view(layer);
  const LayerView high = layer + 1 < count() ? view(layer + 1) : LayerView();
  const std::uint64_t first = low.first();
  const std::uint64_t split = low.end();
  const auto add = [&](auto corner) {
    (result(layer).*extent).add_triangles(low.triangles(), low.mesh->origin, corner);
  };
  // Mostly, both lie in one array: to find the place of each corner takes long.
  if (high.positions == low.positions + low.vertices()) {
    return add([&](std::uint32_t v) { return load(low.positions[v - first]); });
  }
  add([&](std::uint32_t v) {
    return load(v < split ? low.positions[v - first] : high.positions[v - split]);
  });
}

SmoothingEffect SmoothedLayers::effect(std::uint64_t vertices) const {
  LayerExtent before;
  LayerExtent after;
  SmoothingEffect effect;
  for (const SmoothedLayer& layer : results) {
    before.add(layer.before);
    after.add(layer.after);
    effect.mean_displacement_mm += layer.displacement.sum;
    effect.max_displacement_mm = std::max(effect.max_displacement_mm, layer.displacement.largest);
  }
  effect.before = before.extent();
  effect.after = after.extent();
  if (vertices > 0) effect.mean_displacement_mm /= static_cast<double>(vertices);
  return effect;
}

std::uint64_t step_bytes_per_vertex(std::size_t steps) {
  return (kRingLayers * steps + 1) * sizeof(Float4) + (steps + 1) * sizeof(Neighbors) +
         kLayersOfFans * sizeof(Fan) + kLayersOfTriangles * sizeof(Vec3);
}

}  // namespace isomesh::mesh
