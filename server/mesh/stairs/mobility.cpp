#include "server/mesh/stairs/mobility.h"

#include <algorithm>
#include <array>
#include <utility>

#include "server/mesh/stairs/waves.h"

namespace isomesh::mesh {
namespace {

// How much a wall bends outward and inward at a vertex, how near a curve is, and how noisy those
// are. A curve's own bend is apart: it is passed on along the curve only.
enum Reach { kOut, kIn, kNear, kNoise };

// These were found by trial, with spacings of 1:1:1 to 1:1:3, on balls, tubes, boxes, sheets,
// threads and brain atlases. Faces of boxes had to stay where they are, stairs of slopes to vanish
// (`isomesh-bench labels` measures it again). Nothing else singles them out.
//
// A vertex that is a tenth of a sample away from its neighbours' mean bends fully. Steps of stairs
// are several edges long, and only where their two bends reach each other is it a staircase. So
// bends are passed on over six edges, and weaken with each.
constexpr float kBendsPerSample = 10;
constexpr std::size_t kBendSteps = 6;  // from edge to edge
constexpr float kBendLoss = 0.12F;     // with each
constexpr float kNothing = 2;          // more than any of them
// The walls' smoothing gives way to the curve's within four edges of it.
constexpr std::size_t kCurveSteps = 4;
constexpr float kCurveLoss = 0.2F;
// A closed curve of fewer vertices is smoothed less, or it would shrink to a point: at this length
// the strongest smoothing (stairs.cpp) leaves 0.94 of its radius.
constexpr std::size_t kLongCurve = 39;
// Noise makes curves meet again and again. The share of junctions is averaged over so many steps
// along curves. Up to kNoisy a curve is calm; from twice as many on it is noise and stays. Noise on
// a curve also counts as noise in the triangles beside it.
constexpr int kCalmSteps = 4;
constexpr std::size_t kNoiseSteps = 2;
constexpr float kNoisy = 0.15F;

float clamped(float value) { return std::clamp(value, 0.0F, 1.0F); }

class Finder {
 public:
  Finder(const WallShape& shape, const Context& context)
      : shape_(shape), context_(context), reach_(filled(Lanes{})), curve_bends_(filled(0.0F)) {
    for (auto* values : {&found_.moves, &found_.owes}) values->assign(shape.vertices(), 0);
    for (auto* values : {&found_.spread, &found_.calm}) values->assign(shape.vertices(), 1);
  }

  Mobility find() {
    for (std::size_t v = 0; v < shape_.vertices(); ++v) {
      if (shape_.is_curve(v)) found_.curves.push_back(static_cast<std::uint32_t>(v));
    }
    for_vertices([&](std::size_t v) {
      if (shape_.neighbors().degree(v) > 0) find_bends(v);
    });
    find_noise();
    spread_curve_bends();
    spread_reach();
    combine();
    return std::move(found_);
  }

 private:
  // By vertex; behind the last is a zero.
  template <class Value>
  Buffer<Value> filled(Value value) const {
    Buffer<Value> values;
    values.resize_for_overwrite(shape_.vertices());
    std::ranges::fill(values, value);
    return values;
  }

  template <class Body>
  void for_vertices(const Body& body) const {
    for_each(context_, shape_.vertices(), body);
  }

  template <class Body>
  void for_curves(const Body& body) const {
    for_each(context_, found_.curves.size(),
             [&](std::size_t i) { body(std::size_t{found_.curves[i]}); });
  }

  // Each time, all curves' values become what `next` makes of those before.
  template <class Next>
  void repeat_along_curves(int steps, Buffer<float>& values, const Next& next) const {
    Buffer<float> after = filled(0.0F);
    for (int step = 0; step < steps; ++step) {
      for_curves([&](std::size_t v) { after[v] = next(v); });
      std::swap(values, after);
    }
  }

  // Also what is owed for the bend alone, and the diffusivity.
  void find_bends(std::size_t v) {
    Lanes normal = {};
    for (std::size_t fan = shape_.fans().begin(v); fan < shape_.fans().begin(v + 1); ++fan) {
      normal += rotated(shape_.visit_normals(fan, [](Lanes) {}));
    }
    const Lanes in_samples = normal * shape_.spacing();
    const float size = length(in_samples);
    if (size > 0) found_.spread[v] = size / length(normal) / shape_.largest_spacing();
    if (shape_.is_curve(v)) {
      found_.owes[v] = curve_bends_[v] = clamped(kBendsPerSample * length(way_to_mean(v)));
      reach_[v][kNear] = 1;
      return;
    }
    Lanes& bends = reach_[v];
    const auto add = [&](Lanes way, float loss) {
      const float bend = kBendsPerSample * dot(way, in_samples) / size;
      bends[kOut] = std::max(bends[kOut], clamped(bend) - loss);
      bends[kIn] = std::max(bends[kIn], clamped(-bend) - loss);
    };
    if (size > 0) {
      add(way_to_mean(v), 0);
      // A curve bends a wall beside it one way only, even where it goes around an edge.
      shape_.neighbors().visit(v, [&](std::uint32_t neighbor) {
        if (shape_.is_curve(neighbor)) add(way_to_mean(neighbor), kBendLoss);
      });
    }
    found_.owes[v] = std::max(bends[kOut], bends[kIn]);
  }

  // In samples.
  Lanes way_to_mean(std::size_t v) const {
    return without_fourth((shape_.mean(v, shape_.at) - shape_.at[v]) / divisor(shape_.spacing()));
  }

  static Lanes divisor(Lanes spacing) {
    spacing[3] = 1;
    return spacing;
  }
  static Lanes without_fourth(Lanes lanes) {
    lanes[3] = 0;
    return lanes;
  }

  void find_noise() {
    Buffer<float> junctions = filled(0.0F);
    for_curves(
        [&](std::size_t v) { junctions[v] = shape_.neighbors().degree(v) > 2 ? 1.0F : 0.0F; });
    repeat_along_curves(kCalmSteps, junctions, [&](std::size_t v) {
      return 0.5F * junctions[v] + 0.5F * shape_.mean(v, junctions);
    });
    for_curves(
        [&](std::size_t v) { reach_[v][kNoise] = clamped((junctions[v] - kNoisy) / kNoisy); });
  }

  void spread_curve_bends() {
    repeat_along_curves(kBendSteps, curve_bends_, [&](std::size_t v) {
      float most = 0;
      shape_.neighbors().visit(
          v, [&](std::uint32_t neighbor) { most = std::max(most, curve_bends_[neighbor]); });
      return std::max(curve_bends_[v], most - kBendLoss);
    });
  }

  // All four within walls; a curve is near with all its strength beside it, and less with each edge
  // farther away.
  void spread_reach() {
    Buffer<Lanes> other = filled(Lanes{});
    static_assert(kBendSteps % 2 == 0);  // the last writes to reach_
    const std::array<Buffer<Lanes>*, 2> turns = {&reach_, &other};
    const auto pass_on = [&](std::size_t step, std::size_t begin, std::size_t end) {
      const float near_loss = step == 1 ? 0 : step <= kCurveSteps + 1 ? kCurveLoss : kNothing;
      const Lanes loss = {kBendLoss, kBendLoss, near_loss, step <= kNoiseSteps ? 0 : kNothing};
      const Buffer<Lanes>& from = *turns[(step - 1) % 2];
      for (std::size_t v = begin; v < end; ++v) {
        Lanes most = {};
        if (!shape_.is_curve(v)) {
          shape_.neighbors().visit(
              v, [&](std::uint32_t neighbor) { most = larger(most, from[neighbor]); });
        } else if (step <= kNoiseSteps) {
          shape_.visit_triangles(v, [&](std::size_t, std::uint32_t a, std::uint32_t b) {
            most[kNoise] = std::max({most[kNoise], from[a][kNoise], from[b][kNoise]});
          });
        }
        (*turns[step % 2])[v] = larger(from[v], most - loss);
      }
    };
    in_waves(context_, shape_.blocks(), kBendSteps, pass_on);
  }

  // The number of vertices of a closed curve without junctions; for all others, kLongCurve.
  std::size_t length_of_curve(std::size_t start) const {
    std::size_t length = 0;
    std::size_t previous = start;
    std::size_t at = start;
    do {
      if (shape_.neighbors().degree(at) != 2 || ++length == kLongCurve) return kLongCurve;
      std::size_t next = at;
      shape_.neighbors().visit(at, [&](std::uint32_t neighbor) {
        if (next == at && (neighbor != previous || at == start)) next = neighbor;
      });
      previous = std::exchange(at, next);
    } while (at != start);
    return length;
  }

  // The damping by a series of a curve's lowest frequency grows with the square of its length.
  float share_of_curve(std::size_t v) const {
    const auto share = static_cast<float>(length_of_curve(v)) / kLongCurve;
    return share * share;
  }

  void combine() {
    constexpr float kOwedInNoise = 0.3F;
    Buffer<float> both = filled(0.0F);
    for_vertices([&](std::size_t v) {
      both[v] = shape_.is_curve(v) ? curve_bends_[v] : std::min(reach_[v][kOut], reach_[v][kIn]);
    });
    for_vertices([&](std::size_t v) {
      if (shape_.neighbors().degree(v) > 0) {
        found_.moves[v] = std::min(1.0F, both[v] + shape_.mean(v, both));
        found_.owes[v] = std::max(found_.owes[v], found_.moves[v]);
      }
      const float near = reach_[v][kNear];
      const float calm = found_.calm[v] = 1 - reach_[v][kNoise];
      found_.owes[v] *= kOwedInNoise + (1 - kOwedInNoise) * calm;
      if (shape_.is_curve(v)) {
        found_.moves[v] = shape_.neighbors().degree(v) > 1 ? calm * share_of_curve(v) : 0;
      } else if (shape_.is_held(v)) {
        found_.moves[v] = near * calm;
      } else {
        found_.spread[v] = std::max(found_.spread[v], near);
        found_.moves[v] *= calm * found_.spread[v];
      }
    });
    for (std::size_t v = 0; v < shape_.vertices(); ++v) {
      const auto vertex = static_cast<std::uint32_t>(v);
      if (found_.moves[v] > 0) {
        found_.moving.push_back(vertex);
        (shape_.is_curve(v) ? found_.moving_curves : found_.walls).push_back(vertex);
      }
      if (reach_[v][kNear] > 0 && !shape_.is_curve(v)) found_.beside.push_back(vertex);
    }
  }

  const WallShape& shape_;
  const Context& context_;
  Buffer<Lanes> reach_;  // by vertex
  Buffer<float> curve_bends_;
  Mobility found_;
};

}  // namespace

Mobility find_mobility(const WallShape& shape, const Context& context) {
  return Finder(shape, context).find();
}

}  // namespace isomesh::mesh
