#include "server/mesh/smooth/smooth.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "server/mesh/parallel.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/flat_triangles.h"
#include "server/mesh/smooth/layer_steps.h"
#include "server/mesh/smooth/quality.h"

namespace isomesh::mesh {
namespace {

// More steps at once save little: each walk costs about one step in addition.
constexpr std::size_t kUsualSteps = 6;

// The partition of the work: rounds of almost equally many steps; in a round every slab is one
// task.
struct Plan {
  std::size_t slabs = 1;
  std::size_t rounds = 1;
  std::uint64_t bytes = 0;

  // The number of steps before the round.
  std::size_t first_step(std::size_t round, std::size_t steps) const {
    return steps * round / rounds;
  }
};

// The steps around a slab's cuts are made twice. So there are just enough slabs to keep the threads
// busy, and twice as many on a deep volume, so that all threads end at about the same time.
std::size_t count_slabs(std::size_t layers) {
  constexpr std::size_t kFewestLayers = 16;
  constexpr std::size_t kManyLayers = 64;
  const auto threads = static_cast<std::size_t>(thread_count());
  return std::max({std::size_t{1}, std::min(threads, layers / kFewestLayers),
                   std::min(2 * threads, layers / kManyLayers)});
}

// Many steps in one round need many layers at a time. More rounds need a copy of all positions, for
// the displacements at the end. Chooses the one that takes less memory.
Plan plan_for(const SmoothOptions& options, const SurfaceSize& size) {
  const std::size_t steps = options.steps.size();
  Plan plan = {.slabs = count_slabs(size.layers)};
  const auto bytes_with = [&](std::size_t steps_at_once) {
    const auto at_once = std::min(plan.slabs, static_cast<std::size_t>(thread_count()));
    const std::uint64_t copied = plan.slabs * 2 * steps_at_once * sizeof(Vec3);
    return size.largest_layer * (at_once * step_bytes_per_vertex(steps_at_once) + copied);
  };
  const std::size_t rounds = (steps + kUsualSteps - 1) / kUsualSteps;
  const std::uint64_t several =
      bytes_with((steps + rounds - 1) / rounds) + size.vertices * sizeof(Vec3);
  const bool slabs_are_deep = plan.slabs == 1 || 4 * steps <= size.layers / plan.slabs;
  const bool once = rounds == 1 || (slabs_are_deep && bytes_with(steps) <= several);
  plan.rounds = once ? 1 : rounds;
  plan.bytes = once ? bytes_with(steps) : several;
  return plan;
}

bool takes_means(const SmoothOptions& options) { return options.steps.front().move == Move::kMean; }

// Cuts the layers into runs of about equally many vertices.
std::vector<LayerRange> cut_slabs(const Mesh& mesh, std::size_t slabs) {
  std::vector<LayerRange> result;
  LayerRange slab;
  const auto layers = static_cast<std::ptrdiff_t>(mesh.layers());
  for (slab.end = 1; slab.end <= layers; ++slab.end) {
    const std::uint64_t goal = mesh.layer_vertices.back() * (result.size() + 1) / slabs;
    if (slab.end < layers && mesh.layer_vertices[slab.end] < goal) continue;
    result.push_back(slab);
    slab.begin = slab.end;
  }
  return result;
}

// A slab, and copies of the layers on either side that others move meanwhile.
struct MovedSlab {
  LayerRange layers;
  LayerRange around = {};
  std::vector<Vec3> below = {};
  std::vector<Vec3> above = {};
};

class Smoother {
 public:
  Smoother(const SmoothOptions& options, const Context& context, Mesh& mesh)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        size_(size_of({mesh.layer_vertices, mesh.layer_triangles, {}})),
        plan_(plan_for(options, size_)),
        results_(mesh.layers()),
        layers_{[this](std::ptrdiff_t layer) { return view(layer); }, results_} {
    for (const LayerRange& layers : cut_slabs(mesh, plan_.slabs))
      slabs_.push_back({.layers = layers});
    for (const Step& step : options.steps) shares_.push_back(static_cast<float>(step.weight));
  }

  SmoothingEffect run() {
    if (plan_.rounds > 1) {
      extracted_.resize_for_overwrite(mesh_.positions.size());
      for_each(quiet_, mesh_.positions.size(),
               [&](std::size_t v) { extracted_[v] = mesh_.positions[v]; });
    }
    for (std::size_t round = 0; round < plan_.rounds; ++round) run_round(round);
    return layers_.effect(mesh_.positions.size());
  }

 private:
  LayerView view(std::ptrdiff_t layer) const {
    const auto index = static_cast<std::size_t>(layer);
    const std::uint64_t first = mesh_.layer_vertices[index];
    return {&mesh_, index, mesh_.positions.data() + first,
            plan_.rounds > 1 ? extracted_.data() + first : nullptr};
  }

  // The same from a slab, which has copies of others' layers.
  LayerView view(std::ptrdiff_t layer, MovedSlab& slab) const {
    LayerView result = view(layer);
    if (slab.layers.contains(layer)) return result;
    const bool is_below = layer < slab.layers.begin;
    const std::ptrdiff_t first = is_below ? slab.around.begin : slab.layers.end;
    result.positions = (is_below ? slab.below : slab.above).data() +
                       (result.first() - mesh_.layer_vertices[static_cast<std::size_t>(first)]);
    return result;
  }

  std::vector<Vec3> copy_of(std::ptrdiff_t begin, std::ptrdiff_t end) const {
    const Vec3* positions = mesh_.positions.data();
    return {positions + mesh_.layer_vertices[static_cast<std::size_t>(begin)],
            positions + mesh_.layer_vertices[static_cast<std::size_t>(end)]};
  }

  void run_round(std::size_t number) {
    const std::size_t first = plan_.first_step(number, shares_.size());
    const std::size_t last = plan_.first_step(number + 1, shares_.size());
    const Round round = {.shares = std::span(shares_).subspan(first, last - first),
                         .at_curves = options_.at_curves,
                         .max_displacement_mm = options_.max_displacement_mm,
                         .within = options_.within,
                         .largest_layer = size_.largest_layer,
                         .is_first = number == 0,
                         .is_last = number + 1 == plan_.rounds};
    const auto halo = static_cast<std::ptrdiff_t>(round.steps());
    parallel_for(quiet_, slabs_.size(), [&](std::size_t i) {
      MovedSlab& slab = slabs_[i];
      slab.around = {std::max<std::ptrdiff_t>(0, slab.layers.begin - halo),
                     std::min(layers_.count(), slab.layers.end + halo)};
      slab.below = copy_of(slab.around.begin, slab.layers.begin);
      slab.above = copy_of(slab.layers.end, slab.around.end);
      if (round.is_first) measure_seam(slab, &SmoothedLayer::before);
    });
    parallel_for(quiet_, slabs_.size(), [&](std::size_t i) { move(round, slabs_[i]); });
    if (!round.is_last) return;
    parallel_for(quiet_, slabs_.size(),
                 [&](std::size_t i) { measure_seam(slabs_[i], &SmoothedLayer::after); });
    restore_at_seams();
    measure_moved(&SmoothedLayer::was_put_back);
    for (std::ptrdiff_t layer = 0; layer < layers_.count(); ++layer) nudge_flat(layer, layers_);
    measure_moved(&SmoothedLayer::was_nudged);
  }

  void move(const Round& round, MovedSlab& slab) {
    const auto seen = [&](std::ptrdiff_t layer) { return view(layer, slab); };
    LayerSteps steps(round, slab.layers, {seen, results_});
    for (std::ptrdiff_t layer = slab.around.begin; layer < slab.around.end; ++layer) {
      steps.go_on(layer + 1);
      if (slab.layers.contains(layer)) report_layer();
    }
  }

  // Measures the triangles that name vertices of this slab and of the next.
  void measure_seam(const MovedSlab& slab, LayerExtent SmoothedLayer::*extent) {
    const std::ptrdiff_t layer = slab.layers.end - 1;
    if (layer + 1 == layers_.count()) return;
    layers_.add_triangles(layer, layers_.result(layer).*extent);
  }

  // Puts back the vertices that steps leave listed, and those of seams' triangles without area.
  void restore_at_seams() {
    for (std::size_t i = 0; i + 1 < slabs_.size(); ++i) {
      const std::ptrdiff_t layer = slabs_[i].layers.end - 1;
      if (layers_.result(layer).after.has_flat()) list_flat(layer, layers_);
    }
    const auto restore = [&](std::ptrdiff_t layer, MovedSlab& beside) {
      const LayerView before = view(layer, beside);
      put_back(before.extracted != nullptr ? before.extracted : before.positions, layer, layers_);
    };
    for (std::size_t i = 0; i + 1 < slabs_.size(); ++i) {
      restore(slabs_[i].layers.end - 1, slabs_[i + 1]);
      restore(slabs_[i].layers.end, slabs_[i]);
    }
  }

  void measure_moved(bool SmoothedLayer::*was_moved) {
    parallel_for(quiet_, mesh_.layers(), [&](std::size_t layer) {
      measure_again(static_cast<std::ptrdiff_t>(layer), was_moved, layers_);
    });
  }

  void report_layer() {
    context_.throw_if_stopped();
    if (!context_.progress) return;
    const std::size_t done = layers_done_.fetch_add(1, std::memory_order_relaxed) + 1;
    context_.progress(static_cast<double>(done) /
                      static_cast<double>(plan_.rounds * mesh_.layers()));
  }

  const SmoothOptions& options_;
  const Context& context_;
  const Context quiet_;
  Mesh& mesh_;
  const SurfaceSize size_;
  const Plan plan_;
  std::vector<MovedSlab> slabs_;
  std::vector<float> shares_;
  Buffer<Vec3> extracted_;  // only for several rounds
  std::vector<SmoothedLayer> results_;
  const SmoothedLayers layers_;
  std::atomic<std::size_t> layers_done_ = 0;
};

}  // namespace

bool SmoothOptions::goes_outwards() const {
  return std::ranges::any_of(
      steps, [](const Step& step) { return step.move != Move::kMean || step.weight < 0; });
}

std::vector<HalfSpace> box_around(const LatticeToSpace& to_space, const Dims& dims, double wider) {
  const std::array<Point, 3> steps = {to_space.step_x, to_space.step_y, to_space.step_z};
  const std::array<std::uint32_t, 3> counts = {dims.x, dims.y, dims.z};
  std::vector<HalfSpace> box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Point normal = cross(steps[(axis + 1) % 3], steps[(axis + 2) % 3]);
    const double length = std::sqrt(dot(normal, normal));
    for (double& coordinate : normal) coordinate /= length;
    const double step = dot(normal, steps[axis]);  // negative for a left-handed lattice
    const double first = dot(normal, to_space.origin) - wider * step;
    const double last = first + (counts[axis] - 1 + 2 * wider) * step;
    box.push_back({normal, std::max(first, last)});
    for (double& coordinate : normal) coordinate = -coordinate;
    box.push_back({normal, -std::min(first, last)});
  }
  return box;
}

SmoothingEffect smooth(const SmoothOptions& options, const Context& context, Mesh& mesh) {
  if (options.steps.empty() || mesh.positions.size() == 0) {
    const Extent extent = measure_extent(mesh, context);
    return {.before = extent, .after = extent};
  }
  return takes_means(options) ? Smoother(options, context, mesh).run()
                              : smooth_by_quality(options, context, mesh);
}

std::uint64_t smoothing_memory(const SmoothOptions& options, const SurfaceSize& size) {
  if (options.steps.empty() || size.vertices == 0) return 0;
  return takes_means(options) ? plan_for(options, size).bytes : quality_memory(size);
}

}  // namespace isomesh::mesh
