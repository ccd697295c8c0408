#include "server/mesh/smooth/smooth.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "server/mesh/parallel.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/quality.h"
#include "server/mesh/smooth/sweep.h"

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
    return size.largest_layer * (at_once * sweep_bytes_per_vertex(steps_at_once) + copied);
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

LayerCopy copy_of(const Mesh& mesh, const LayerRange& layers) {
  if (layers.begin >= layers.end) return {layers, {}};
  const auto vertices = mesh.positions.span().subspan(
      mesh.layer_vertices[layers.begin],
      mesh.layer_vertices[layers.end] - mesh.layer_vertices[layers.begin]);
  return {layers, {vertices.begin(), vertices.end()}};
}

Extent sum_of(const std::vector<LayerExtent>& layers) {
  LayerExtent whole;
  for (const LayerExtent& layer : layers) whole.add(layer);
  return whole.extent();
}

class Smoother {
 public:
  Smoother(const SmoothOptions& options, const Context& context, Mesh& mesh)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        plan_(plan_for(options, size_of({mesh.layer_vertices, mesh.layer_triangles, {}}))),
        slabs_(cut_slabs(mesh, plan_.slabs)),
        before_(mesh.layers()),
        after_(mesh.layers()),
        displacements_(mesh.layers()),
        flat_(mesh.layers()) {
    for (const Step& step : options.steps) shares_.push_back(static_cast<float>(step.weight));
  }

  SmoothingEffect run() {
    if (plan_.rounds > 1) {
      extracted_.resize_for_overwrite(mesh_.positions.size());
      parallel_for(quiet_, slabs_.size(), [&](std::size_t i) { keep_extracted(slabs_[i]); });
    }
    for (std::size_t round = 0; round < plan_.rounds; ++round) run_round(round);
    return summary();
  }

 private:
  void keep_extracted(const LayerRange& slab) {
    const Vec3* from = mesh_.positions.data();
    std::copy(from + mesh_.layer_vertices[slab.begin], from + mesh_.layer_vertices[slab.end],
              extracted_.data() + mesh_.layer_vertices[slab.begin]);
  }

  void run_round(std::size_t number) {
    const std::size_t first = plan_.first_step(number, shares_.size());
    const std::size_t last = plan_.first_step(number + 1, shares_.size());
    const bool is_last = number + 1 == plan_.rounds;
    const Round round = {.mesh = mesh_,
                         .shares = std::span(shares_).subspan(first, last - first),
                         .at_curves = options_.at_curves,
                         .max_displacement_mm = options_.max_displacement_mm,
                         .within = options_.within,
                         .extracted = plan_.rounds > 1 ? extracted_.data() : nullptr,
                         .before = number == 0 ? before_.data() : nullptr,
                         .after = is_last ? after_.data() : nullptr,
                         .displacements = displacements_.data(),
                         .flat = flat_.data()};

    std::vector<LayerCopy> below(slabs_.size());
    std::vector<LayerCopy> above(slabs_.size());
    parallel_for(quiet_, slabs_.size(), [&](std::size_t i) {
      const LayerRange all = with_halo(round, slabs_[i], round.steps());
      below[i] = copy_of(mesh_, {all.begin, slabs_[i].begin});
      above[i] = copy_of(mesh_, {slabs_[i].end, all.end});
      if (number == 0) measure_seam(i, before_);
    });
    parallel_for(quiet_, slabs_.size(), [&](std::size_t i) {
      sweep(round, slabs_[i], below[i], above[i], [&] { report_layer(); });
    });
    if (!is_last) return;
    parallel_for(quiet_, slabs_.size(), [&](std::size_t i) { measure_seam(i, after_); });
    restore_at_seams(below, above);
    measure_moved();
    nudge_flat();
    measure_moved();
  }

  // Measures the triangles that name vertices of this slab and of the next.
  void measure_seam(std::size_t slab, std::vector<LayerExtent>& extents) {
    const auto layer = static_cast<std::size_t>(slabs_[slab].end) - 1;
    if (layer + 1 < mesh_.layers()) add_triangles(mesh_, layer, extents[layer]);
  }

  // Puts back the vertices that sweeps leave listed, and those of seams' triangles without area.
  void restore_at_seams(const std::vector<LayerCopy>& below, const std::vector<LayerCopy>& above) {
    for (std::size_t i = 0; i + 1 < slabs_.size(); ++i) {
      const auto layer = static_cast<std::size_t>(slabs_[i].end) - 1;
      if (after_[layer].has_flat()) list_flat(mesh_, layer, flat_.data());
    }
    const auto restore = [&](std::ptrdiff_t layer, const LayerCopy& copy) {
      const auto index = static_cast<std::size_t>(layer);
      const Vec3* extracted = plan_.rounds > 1 ? extracted_.data() + mesh_.layer_vertices[index]
                                               : copy.layer(mesh_, layer);
      put_back(extracted, index, mesh_, flat_[index], displacements_[index]);
    };
    for (std::size_t i = 0; i + 1 < slabs_.size(); ++i) {
      restore(slabs_[i].end - 1, below[i + 1]);
      restore(slabs_[i].end, above[i]);
    }
  }

  // Measures again what vertices name that were moved after their layer was measured.
  void measure_moved() {
    parallel_for(quiet_, mesh_.layers(), [&](std::size_t layer) {
      const bool is_last = layer + 1 == mesh_.layers();
      if (!flat_[layer].were_moved && (is_last || !flat_[layer + 1].were_moved)) return;
      after_[layer] = {};
      for (auto v = mesh_.layer_vertices[layer]; v < mesh_.layer_vertices[layer + 1]; ++v) {
        after_[layer].add_vertex(load(mesh_.positions[v]));
      }
      add_triangles(mesh_, layer, after_[layer]);
    });
    for (FlatVertices& flat : flat_) flat.were_moved = false;
  }

  // Beside slivers, which samples that equal the iso-value have around them, one corner that is put
  // back can come to lie in line with two others that are not.
  void nudge_flat() {
    for (std::size_t layer = 0; layer < mesh_.layers(); ++layer) {
      if (!after_[layer].has_flat()) continue;
      for (const Triangle& triangle : mesh_.triangles_of(layer, layer + 1)) {
        if (!has_no_area(mesh_, triangle)) continue;
        for (const std::uint32_t vertex : triangle) {
          const std::size_t of_vertex =
              vertex < mesh_.layer_vertices[layer + 1] ? layer : layer + 1;
          if (!nudge(vertex, of_vertex)) continue;
          flat_[of_vertex].were_moved = true;
          break;
        }
      }
    }
  }

  // Moves the vertex by about the rounding of its position, such that its triangles have areas.
  // Returns false if there is no such move, or if the vertex is not free.
  bool nudge(std::uint32_t vertex, std::size_t layer) {
    std::vector<Triangle> around;
    std::int64_t next_minus_previous = 0;  // not 0 on the boundary of a manifold
    for (const Triangle& triangle :
         mesh_.triangles_of(layer - std::min<std::size_t>(layer, 1), layer + 1)) {
      const std::size_t corner = std::ranges::find(triangle, vertex) - triangle.begin();
      if (corner == triangle.size()) continue;
      around.push_back(triangle);
      next_minus_previous += std::int64_t{triangle[(corner + 1) % 3]} - triangle[(corner + 2) % 3];
    }
    if (next_minus_previous != 0 || mesh_.is_on_border(vertex) || mesh_.is_on_line(vertex)) {
      return false;
    }
    float largest = 0;
    for (const Triangle& triangle : around) {
      for (const std::uint32_t corner : triangle) {
        for (const float at : mesh_.positions[corner]) largest = std::max(largest, std::abs(at));
      }
    }
    const Vec3 position = mesh_.positions[vertex];
    for (const float step : {largest * 0x1p-22F, -largest * 0x1p-22F}) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        mesh_.positions[vertex][axis] = position[axis] + step;
        if (std::ranges::none_of(around,
                                 [&](const Triangle& t) { return has_no_area(mesh_, t); })) {
          return true;
        }
        mesh_.positions[vertex] = position;
      }
    }
    return false;
  }

  void report_layer() {
    context_.throw_if_stopped();
    if (!context_.progress) return;
    const std::size_t done = layers_done_.fetch_add(1, std::memory_order_relaxed) + 1;
    context_.progress(static_cast<double>(done) /
                      static_cast<double>(plan_.rounds * mesh_.layers()));
  }

  SmoothingEffect summary() const {
    SmoothingEffect result = {.before = sum_of(before_), .after = sum_of(after_)};
    for (const LayerDisplacement& layer : displacements_) {
      result.mean_displacement_mm += layer.sum;
      result.max_displacement_mm = std::max(result.max_displacement_mm, layer.largest);
    }
    if (mesh_.positions.size() > 0) {
      result.mean_displacement_mm /= static_cast<double>(mesh_.positions.size());
    }
    return result;
  }

  const SmoothOptions& options_;
  const Context& context_;
  const Context quiet_;
  Mesh& mesh_;
  const Plan plan_;
  const std::vector<LayerRange> slabs_;
  std::vector<float> shares_;
  Buffer<Vec3> extracted_;  // only for several rounds
  std::vector<LayerExtent> before_;
  std::vector<LayerExtent> after_;
  std::vector<LayerDisplacement> displacements_;
  std::vector<FlatVertices> flat_;
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
