#include "server/mesh/smooth/quality.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/fan_moves.h"
#include "server/mesh/smooth/flat_triangles.h"
#include "server/mesh/smooth/layer_steps.h"
#include "server/mesh/smooth/rings.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kSlabLayers = 4;
constexpr std::size_t kMostColors = Rings::kMostNeighbors + 1;

// The free vertices of a slab, by colour: those of colour c are [begin[c], begin[c + 1]).
struct ColoredSlab {
  std::vector<std::uint32_t> vertices;
  std::vector<std::size_t> begin;
};

class QualitySmoother {
 public:
  QualitySmoother(const SmoothOptions& options, const Context& context, Mesh& mesh)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        rings_(mesh, quiet_),
        slabs_((mesh.layers() + kSlabLayers - 1) / kSlabLayers) {
    const std::size_t vertices = mesh.positions.size();
    extracted_.resize_for_overwrite(vertices);
    home_.resize_for_overwrite(vertices);
    parallel_for(quiet_, slabs_.size(), [&](std::size_t slab) {
      for (std::uint64_t v = first_vertex(slab); v < first_vertex(slab + 1); ++v) {
        extracted_[v] = mesh.positions[v];
        home_[v] = static_cast<std::uint32_t>(v);
      }
      color(slab);
    });
  }

  void run() {
    for (const Step& step : options_.steps) {
      for (const std::size_t parity : {0, 1}) {
        parallel_for(quiet_, (slabs_.size() + 1 - parity) / 2, [&](std::size_t i) {
          move(slabs_[2 * i + parity], step.move);
          report_slab();
        });
      }
    }
  }

  void add_displacements(SmoothingEffect& effect) const {
    std::vector<LayerDisplacement> of_slabs(slabs_.size());
    parallel_for(quiet_, slabs_.size(), [&](std::size_t slab) {
      for (std::uint64_t v = first_vertex(slab); v < first_vertex(slab + 1); ++v) {
        of_slabs[slab].add(extracted_[v], mesh_.positions[v]);
      }
    });
    for (const auto& [sum, largest] : of_slabs) {
      effect.mean_displacement_mm += sum / static_cast<double>(mesh_.positions.size());
      effect.max_displacement_mm = std::max(effect.max_displacement_mm, largest);
    }
  }

 private:
  std::uint64_t first_vertex(std::size_t slab) const {
    return mesh_.layer_vertices[std::min(slab * kSlabLayers, mesh_.layers())];
  }

  bool is_free(std::size_t vertex) const {
    return rings_.has_ring(vertex) && !mesh_.is_on_border(vertex) && !mesh_.is_on_line(vertex);
  }

  // Gives each vertex the first colour that no earlier neighbour in the slab has.
  void color(std::size_t slab) {
    const std::uint64_t first = first_vertex(slab);
    const std::uint64_t end = first_vertex(slab + 1);
    constexpr std::uint8_t kNone = kMostColors;
    std::vector<std::uint8_t> colors(end - first, kNone);
    std::array<std::size_t, kMostColors> counts = {};
    for (std::uint64_t v = first; v < end; ++v) {
      if (!is_free(v)) continue;
      std::uint64_t taken = 0;
      for (const std::uint32_t neighbor : rings_.around(v)) {
        if (neighbor >= first && neighbor < v)
          taken |= std::uint64_t{1} << colors[neighbor - first];
      }
      colors[v - first] = static_cast<std::uint8_t>(std::countr_one(taken));
      ++counts[colors[v - first]];
    }
    ColoredSlab& colored = slabs_[slab];
    colored.begin = {0};
    for (std::size_t c = 0; c < kMostColors && counts[c] > 0; ++c) {
      colored.begin.push_back(colored.begin.back() + counts[c]);
    }
    colored.vertices.resize(colored.begin.back());
    std::vector<std::size_t> next = colored.begin;
    for (std::uint64_t v = first; v < end; ++v) {
      const std::uint8_t its = colors[v - first];
      if (its != kNone) colored.vertices[next[its]++] = static_cast<std::uint32_t>(v);
    }
  }

  void move(const ColoredSlab& slab, Move move) {
    // A distance in single precision may be slightly too small.
    constexpr double kSurely = 1 - 1e-6;
    const FanMoves moves = {
        .rings = rings_,
        .extracted = extracted_.data(),
        .positions = mesh_.positions.data(),
        .home = home_.data(),
        .max_displacement = static_cast<float>(options_.max_displacement_mm * kSurely)};
    for (std::size_t c = 0; c + 1 < slab.begin.size(); ++c) {
      const auto vertices =
          std::span(slab.vertices).subspan(slab.begin[c], slab.begin[c + 1] - slab.begin[c]);
      move_fans(moves, move, vertices);
      if (!options_.within.empty()) hold_within(vertices);
    }
  }

  // Pulls vertices back that moved out of a half-space, or farther out than they were extracted.
  void hold_within(std::span<const std::uint32_t> vertices) {
    for (const std::uint32_t v : vertices) {
      for (const HalfSpace& half : options_.within) {
        const double start = dot(half.normal, to_point(extracted_[v])) - half.offset;
        const double beyond =
            dot(half.normal, to_point(mesh_.positions[v])) - half.offset - std::max(0.0, start);
        if (beyond <= 0) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          mesh_.positions[v][axis] =
              static_cast<float>(mesh_.positions[v][axis] - beyond * half.normal[axis]);
        }
      }
    }
  }

  void report_slab() {
    if (!context_.progress) return;
    const std::size_t done = slabs_done_.fetch_add(1, std::memory_order_relaxed) + 1;
    const std::size_t all = slabs_.size() * options_.steps.size();
    context_.progress(static_cast<double>(done) / static_cast<double>(all));
  }

  const SmoothOptions& options_;
  const Context& context_;
  const Context quiet_;
  Mesh& mesh_;
  const Rings rings_;
  std::vector<ColoredSlab> slabs_;
  Buffer<Vec3> extracted_;
  Buffer<std::uint32_t> home_;
  std::atomic<std::size_t> slabs_done_ = 0;
};

}  // namespace

SmoothingEffect smooth_by_quality(const SmoothOptions& options, const Context& context,
                                  Mesh& mesh) {
  const Context quiet = {context.stop, nullptr};
  SmoothingEffect effect;
  effect.before = measure_extent(mesh, quiet);
  QualitySmoother smoother(options, context, mesh);
  smoother.run();
  effect.after = open_flat(quiet, mesh);
  smoother.add_displacements(effect);
  return effect;
}

std::uint64_t quality_memory(const SurfaceSize& size) {
  // Positions, homes and the order of the moves.
  constexpr std::uint64_t kVertex = sizeof(Vec3) + 2 * sizeof(std::uint32_t);
  // While rings are sorted and slabs are coloured, for each thread: six triangles a vertex.
  constexpr std::uint64_t kOfLayer = 6 * 2 * sizeof(std::uint32_t) + 2 * sizeof(std::uint64_t);
  return Rings::bytes(size.vertices, size.triangles) + size.vertices * kVertex +
         static_cast<std::uint64_t>(thread_count()) * size.largest_layer() * kOfLayer;
}

}  // namespace isomesh::mesh
