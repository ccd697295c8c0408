#include "server/mesh/stairs/mobility.h"

#include <algorithm>
#include <array>
#include <utility>

namespace isomesh::mesh {
namespace {

// How much a wall bends outward and inward at a vertex.
struct Bends {
  float out = 0;
  float in = 0;
};

// These were found by trial, with spacings of 1:1:1 to 1:1:3, on balls, tubes, boxes, sheets,
// threads and brain atlases. Faces of boxes had to stay where they are, stairs of slopes to vanish
// (`isomesh-bench labels` measures it again). Nothing else singles them out.
//
// A vertex that is a tenth of a sample away from its neighbours' mean bends fully. Steps of stairs
// are several edges long, and only where their two bends reach each other is it a staircase. So
// bends are passed on over six edges, and weaken with each.
constexpr float kBendsPerSample = 10;
constexpr int kBendSteps = 6;       // from edge to edge
constexpr float kBendLoss = 0.12F;  // with each
constexpr float kNoBend = 2;        // more than any bend
// The walls' smoothing gives way to the curve's within four edges of it.
constexpr int kCurveSteps = 4;
constexpr float kCurveLoss = 0.2F;
// A closed curve of fewer vertices is smoothed less, or it would shrink to a point: at this length
// the strongest smoothing (stairs.cpp) leaves 0.94 of its radius.
constexpr std::size_t kLongCurve = 39;
// Noise makes curves meet again and again. The share of junctions is averaged over so many steps
// along curves. Up to kNoisy a curve is calm; from twice as many on it is noise and stays.
constexpr int kCalmSteps = 4;
constexpr float kNoisy = 0.15F;

float clamped(float value) { return std::clamp(value, 0.0F, 1.0F); }

class Finder {
 public:
  Finder(const WallShape& shape, const Context& context)
      : shape_(shape), context_(context), near_curve_(filled(0.0F)) {
    for (auto* values : {&found_.moves, &found_.owes}) values->assign(shape.vertices(), 0);
    for (auto* values : {&found_.spread, &found_.calm}) values->assign(shape.vertices(), 1);
  }

  Mobility find() {
    find_staircases();
    find_near_curves();
    find_noise();
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
  static Buffer<float> copy_of(const Buffer<float>& values) {
    Buffer<float> copy;
    std::ranges::copy(values, copy.resize_for_overwrite(values.size()));
    return copy;
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

  void find_staircases() {
    Buffer<Bends> bends = filled(Bends{});
    Buffer<Bends> next = filled(Bends{});
    for_vertices([&](std::size_t v) {
      if (shape_.neighbors().degree(v) > 0) bends[v] = bends_at(v);
    });
    for (int step = 0; step < kBendSteps; ++step) {
      for_vertices([&](std::size_t v) {
        Bends most = bends[v];
        const bool is_curve = shape_.is_curve(v);
        shape_.neighbors().visit(v, [&](std::uint32_t neighbor) {
          const float loss = shape_.is_curve(neighbor) != is_curve ? kNoBend : kBendLoss;
          most.out = std::max(most.out, bends[neighbor].out - loss);
          most.in = std::max(most.in, bends[neighbor].in - loss);
        });
        next[v] = most;
      });
      std::swap(bends, next);
    }
    const auto both = [&](std::size_t v) { return std::min(bends[v].out, bends[v].in); };
    for_vertices([&](std::size_t v) {
      float sum = 0;
      shape_.neighbors().visit(v, [&](std::uint32_t neighbor) { sum += both(neighbor); });
      const auto count = static_cast<float>(shape_.neighbors().degree(v));
      if (count == 0) return;
      found_.moves[v] = std::min(1.0F, both(v) + sum / count);
      found_.owes[v] = std::max(found_.owes[v], found_.moves[v]);
    });
  }

  // Also what is owed for the bend alone, and the diffusivity.
  Bends bends_at(std::size_t v) {
    Lanes normal = {};
    shape_.visit_spokes(
        v, [&](std::size_t, const Spoke& spoke) { normal += shape_.normal(v, spoke); });
    const Lanes in_samples = normal * shape_.spacing();
    const float size = length(in_samples);
    if (size > 0) found_.spread[v] = size / length(normal) / shape_.largest_spacing();
    Bends bends;
    if (shape_.is_curve(v)) {
      bends.out = bends.in = clamped(kBendsPerSample * length(way_to_mean(v)));
    } else if (size > 0) {
      const auto add = [&](Lanes way, float loss) {
        const float bend = kBendsPerSample * dot(way, in_samples) / size;
        bends.out = std::max(bends.out, clamped(bend) - loss);
        bends.in = std::max(bends.in, clamped(-bend) - loss);
      };
      add(way_to_mean(v), 0);
      // A curve bends a wall beside it one way only, even where it goes around an edge.
      shape_.neighbors().visit(v, [&](std::uint32_t neighbor) {
        if (shape_.is_curve(neighbor)) add(way_to_mean(neighbor), kBendLoss);
      });
    }
    found_.owes[v] = std::max(bends.out, bends.in);
    return bends;
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

  // 1 on curves and beside them, less with each edge farther away.
  void find_near_curves() {
    for (std::size_t v = 0; v < shape_.vertices(); ++v) {
      if (!shape_.is_curve(v)) continue;
      found_.curves.push_back(static_cast<std::uint32_t>(v));
      near_curve_[v] = 1;
    }
    Buffer<float> next = copy_of(near_curve_);
    for (int step = 0; step <= kCurveSteps; ++step) {
      const float loss = step == 0 ? 0 : kCurveLoss;
      for_vertices([&](std::size_t v) {
        float most = near_curve_[v];
        if (shape_.is_curve(v)) return;
        shape_.neighbors().visit(v, [&](std::uint32_t neighbor) {
          most = std::max(most, near_curve_[neighbor] - loss);
        });
        next[v] = most;
      });
      std::swap(near_curve_, next);
    }
    for (std::size_t v = 0; v < shape_.vertices(); ++v) {
      const bool is_beside = near_curve_[v] > 0 && !shape_.is_curve(v);
      if (is_beside) found_.beside.push_back(static_cast<std::uint32_t>(v));
    }
  }

  void find_noise() {
    Buffer<float> junctions = filled(0.0F);
    for_curves(
        [&](std::size_t v) { junctions[v] = shape_.neighbors().degree(v) > 2 ? 1.0F : 0.0F; });
    Buffer<float> next = copy_of(junctions);
    for (int step = 0; step < kCalmSteps; ++step) {
      for_curves(
          [&](std::size_t v) { next[v] = 0.5F * junctions[v] + 0.5F * shape_.mean(v, junctions); });
      std::swap(junctions, next);
    }
    for_curves(
        [&](std::size_t v) { found_.calm[v] = 1 - clamped((junctions[v] - kNoisy) / kNoisy); });
    // Noise on a curve also counts as noise in the triangles beside it.
    for (int step = 0; step < 2; ++step) {
      std::vector<float> least = found_.calm;
      for_vertices([&](std::size_t v) {
        shape_.visit_spokes(v, [&](std::size_t, const Spoke& spoke) {
          least[v] = std::min({least[v], found_.calm[spoke.next], found_.calm[spoke.previous]});
        });
      });
      found_.calm.swap(least);
    }
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
    for_vertices([&](std::size_t v) {
      const float calm = found_.calm[v];
      found_.owes[v] *= kOwedInNoise + (1 - kOwedInNoise) * calm;
      if (shape_.is_curve(v)) {
        found_.moves[v] = shape_.neighbors().degree(v) > 1 ? calm * share_of_curve(v) : 0;
      } else if (shape_.is_held(v)) {
        found_.moves[v] = near_curve_[v] * calm;
      } else {
        found_.spread[v] = std::max(found_.spread[v], near_curve_[v]);
        found_.moves[v] *= calm * found_.spread[v];
      }
    });
    for (std::size_t v = 0; v < shape_.vertices(); ++v) {
      if (found_.moves[v] > 0) found_.moving.push_back(static_cast<std::uint32_t>(v));
    }
  }

  const WallShape& shape_;
  const Context& context_;
  Buffer<float> near_curve_;
  Mobility found_;
};

}  // namespace

Mobility find_mobility(const WallShape& shape, const Context& context) {
  return Finder(shape, context).find();
}

}  // namespace isomesh::mesh
