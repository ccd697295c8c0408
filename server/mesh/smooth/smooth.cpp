#include "server/mesh/smooth/smooth.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
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

// The partition of the work: rounds of almost equally many steps; in a round every run of layers is
// one task.
struct Plan {
  std::size_t runs = 1;
  std::size_t rounds = 1;
  std::uint64_t bytes = 0;

  // The number of steps before the round.
  std::size_t first_step(std::size_t round, std::size_t steps) const {
    return steps * round / rounds;
  }
};

// The steps around a run's ends are made twice. So there are just enough runs to keep the threads
// busy, and twice as many on a deep volume, so that all threads end at about the same time.
std::size_t count_runs(std::size_t layers) {
  constexpr std::size_t kFewestLayers = 16;
  constexpr std::size_t kManyLayers = 64;
  const auto threads = static_cast<std::size_t>(thread_count());
  if (layers >= 2 * threads * kManyLayers) return 2 * threads;
  return std::clamp<std::size_t>(layers / kFewestLayers, 1, threads);
}

// Many steps in one round need many layers at a time. More rounds need a copy of all positions, for
// the displacements at the end. Chooses the one that takes less memory.
Plan plan_for(const SmoothOptions& options, const SurfaceSize& size) {
  const std::size_t steps = options.steps.size();
  Plan plan = {.runs = count_runs(size.layers)};
  const auto bytes_with = [&](std::size_t steps_at_once) {
    const auto at_once = std::min(plan.runs, static_cast<std::size_t>(thread_count()));
    const std::uint64_t copied =
        plan.runs * (2 * steps_at_once + kBelowRun + kAboveRun) * sizeof(Vec3);
    return size.largest_layer() * (at_once * step_bytes_per_vertex(steps_at_once) + copied);
  };
  const std::size_t rounds = (steps + kUsualSteps - 1) / kUsualSteps;
  const std::uint64_t several =
      bytes_with((steps + rounds - 1) / rounds) + size.vertices * sizeof(Vec3);
  const bool runs_are_deep = plan.runs == 1 || 4 * steps <= size.layers / plan.runs;
  const bool once = rounds == 1 || (runs_are_deep && bytes_with(steps) <= several);
  plan.rounds = once ? 1 : rounds;
  plan.bytes = once ? bytes_with(steps) : several;
  return plan;
}

bool takes_means(const SmoothOptions& options) { return options.steps.front().move == Move::kMean; }

// Cuts the layers into runs of about equally many vertices.
std::vector<LayerRange> cut_runs(const Mesh& mesh, std::size_t runs) {
  std::vector<LayerRange> result;
  LayerRange run;
  const auto layers = static_cast<std::ptrdiff_t>(mesh.layers());
  for (run.end = 1; run.end <= layers; ++run.end) {
    const std::uint64_t goal = mesh.layer_vertices.back() * (result.size() + 1) / runs;
    if (run.end < layers && mesh.layer_vertices[run.end] < goal) continue;
    result.push_back(run);
    run.begin = run.end;
  }
  return result;
}

class Smoother {
 public:
  Smoother(const SmoothOptions& options, const Context& context, Mesh& mesh)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        size_(size_of({mesh.layer_vertices, mesh.layer_triangles, {}})),
        plan_(plan_for(options, size_)),
        runs_(cut_runs(mesh, plan_.runs)),
        results_(mesh.layers()) {}

  SmoothingEffect run() {
    if (plan_.rounds > 1) {
      extracted_.resize_for_overwrite(mesh_.positions.size());
      for_each(quiet_, mesh_.positions.size(),
               [&](std::size_t v) { extracted_[v] = mesh_.positions[v]; });
    }
    for (std::size_t round = 0; round < plan_.rounds; ++round) run_round(round);
    const SmoothedLayers layers = {[this](std::ptrdiff_t layer) { return view(layer); }, results_};
    FlatTriangles(layers).go_on(layers.count());
    return layers.effect(mesh_.positions.size());
  }

 private:
  // A run, with copies of the layers around it that others move meanwhile.
  class CopiedRun {
   public:
    CopiedRun(Smoother& owner, const Round& round, const LayerRange& own)
        : owner_(owner),
          own_(own),
          around_(LayerSteps::around(round, own, owner.count())),
          below_(owner.copy_of({around_.begin, own.begin})),
          above_(owner.copy_of({own.end, around_.end})) {}

    void move(const Round& round) {
      const LayerRange own = {own_.begin - around_.begin, own_.end - around_.begin};
      std::vector<SmoothedLayer> results(around_.end - around_.begin);
      const auto kept = owner_.results_.begin() + own_.begin;
      std::move(kept, kept + (own.end - own.begin), results.begin() + own.begin);
      const auto at = [this](std::ptrdiff_t layer) { return view(around_.begin + layer); };
      LayerSteps steps(round, own, {at, results});
      for (std::ptrdiff_t layer = around_.begin; layer < around_.end; ++layer) {
        steps.go_on(layer + 1 - around_.begin);
        if (own_.contains(layer)) owner_.report_layer();
      }
      std::move(results.begin() + own.begin, results.begin() + own.end, kept);
    }

   private:
    LayerView view(std::ptrdiff_t layer) {
      LayerView result = owner_.view(layer);
      if (own_.contains(layer)) return result;
      const bool is_below = layer < own_.begin;
      const std::uint64_t first = owner_.first_vertex(is_below ? around_.begin : own_.end);
      result.positions = (is_below ? below_ : above_).data() + (result.first() - first);
      return result;
    }

    Smoother& owner_;
    const LayerRange own_;
    const LayerRange around_;
    std::vector<Vec3> below_;
    std::vector<Vec3> above_;
  };

  std::ptrdiff_t count() const { return static_cast<std::ptrdiff_t>(mesh_.layers()); }
  std::uint64_t first_vertex(std::ptrdiff_t layer) const {
    return mesh_.layer_vertices[static_cast<std::size_t>(layer)];
  }

  LayerView view(std::ptrdiff_t layer) const {
    const std::uint64_t first = first_vertex(layer);
    return {&mesh_, static_cast<std::size_t>(layer), mesh_.positions.data() + first,
            plan_.rounds > 1 ? extracted_.data() + first : nullptr};
  }

  std::vector<Vec3> copy_of(const LayerRange& layers) const {
    const Vec3* positions = mesh_.positions.data();
    return {positions + first_vertex(layers.begin), positions + first_vertex(layers.end)};
  }

  void run_round(std::size_t number) {
    const std::size_t steps = options_.steps.size();
    const Round round = {options_, plan_.first_step(number, steps),
                         plan_.first_step(number + 1, steps), size_.largest_layer()};
    std::vector<std::optional<CopiedRun>> copied(runs_.size());
    parallel_for(quiet_, runs_.size(),
                 [&](std::size_t i) { copied[i].emplace(*this, round, runs_[i]); });
    parallel_for(quiet_, runs_.size(), [&](std::size_t i) { copied[i]->move(round); });
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
  const std::vector<LayerRange> runs_;
  Buffer<Vec3> extracted_;  // only for several rounds
  std::vector<SmoothedLayer> results_;
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
    const Extent before = measure_extent(mesh, context);
    return {.before = before, .after = open_flat(context, mesh)};
  }
  return takes_means(options) ? Smoother(options, context, mesh).run()
                              : smooth_by_quality(options, context, mesh);
}

std::uint64_t smoothing_memory(const SmoothOptions& options, const SurfaceSize& size) {
  if (options.steps.empty() || size.vertices == 0) return 0;
  return takes_means(options) ? plan_for(options, size).bytes : quality_memory(size);
}

}  // namespace isomesh::mesh
