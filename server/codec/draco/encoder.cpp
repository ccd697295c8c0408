#include "server/codec/draco/encoder.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "server/codec/draco/chunks.h"
#include "server/codec/draco/corners.h"
#include "server/codec/draco/fans.h"
#include "server/codec/draco/normal_coder.h"
#include "server/codec/draco/opposites.h"
#include "server/codec/draco/quantise.h"
#include "server/codec/draco/residual_coder.h"
#include "server/codec/draco/residuals.h"
#include "server/codec/draco/starts.h"
#include "server/codec/draco/stream.h"
#include "server/codec/draco/traversal.h"
#include "server/codec/draco/value_order.h"
#include "server/mesh/buffer.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::edgebreaker {
namespace {

constexpr std::size_t kMostVertices = std::size_t{1} << 31;

bool is_covered(const Surface& surface, const Grid& grid) {
  return !surface.triangles.empty() && surface.triangles.size() <= kMostFaces &&
         surface.positions.size() < kMostVertices && grid.bits <= Encoder::kMostPositionBits &&
         std::isfinite(grid.side) && grid.side > 0 &&
         (surface.normals.empty() || surface.normals.size() == surface.positions.size());
}

bool has_layers(const Surface& surface) {
  const auto lead_to = [](std::span<const std::uint64_t> offsets, std::size_t count) {
    return offsets.size() > 1 && offsets.front() == 0 && offsets.back() == count &&
           std::ranges::is_sorted(offsets);
  };
  return surface.layer_vertices.size() == surface.layer_triangles.size() &&
         lead_to(surface.layer_vertices, surface.positions.size()) &&
         lead_to(surface.layer_triangles, surface.triangles.size());
}

// parallel_for, or a loop for one thread.
template <class Body>
void run(Threads threads, const mesh::Context& context, std::size_t tasks, Body body) {
  if (threads == Threads::kAll) {
    mesh::parallel_for({context.stop, nullptr}, tasks, body);
  } else {
    for (std::size_t task = 0; task < tasks; ++task) body(task);
  }
}

// For a surface after its traversal, with every vertex in a triangle. `boundary` holds the corners
// without an opposite. Vertices are numbered as before Fans::separate.
mesh::PartTopology part_topology(const Connectivity& surface,
                                 const std::vector<std::vector<Corner>>& boundary, const Fans& fans,
                                 const Traversal& traversal) {
  const std::vector<Vertex>& originals = fans.originals();
  const auto vertices = surface.vertices - static_cast<Vertex>(originals.size());
  const auto original = [&](Vertex vertex) {
    return vertex < vertices ? vertex : originals[vertex - vertices];
  };
  mesh::PartTopology part;
  part.inner.assign((vertices + 63) / 64, ~std::uint64_t{0});
  if (vertices % 64 != 0) part.inner.back() = (std::uint64_t{1} << vertices % 64) - 1;
  fans.for_each_on_boundary([&](Vertex vertex) {
    if (vertex < vertices) part.inner[vertex / 64] &= ~(std::uint64_t{1} << vertex % 64);
  });
  for (const std::vector<Corner>& corners : boundary) {
    for (const Corner outer : corners) {
      // Each open fan begins at a boundary edge.
      for (Corner corner = next(outer);;) {
        part.rim.push_back({original(surface.vertex(corner)),
                            original(surface.vertex(next(corner))),
                            original(surface.vertex(previous(corner)))});
        const Corner across = surface.opposite(next(corner));
        if (across == surface.none) break;
        corner = next(across);
      }
    }
  }
  part.components = traversal.components();
  part.rim_components.reserve(traversal.rim().size());
  for (const auto& [vertex, component] : traversal.rim()) {
    part.rim_components.push_back({original(vertex), component});
  }
  return part;
}

}  // namespace

// The stages, sequential and parallel, with their memory.
class Encoder::Stages {
 public:
  explicit Stages(std::size_t least_to_look_ahead) : traversal_(least_to_look_ahead) {}

  std::optional<Encoded> encode(const Surface& surface, const Grid& grid, Threads threads,
                                const mesh::Context& context);

 private:
  bool connect(const Surface& surface, Threads threads, const mesh::Context& context);
  bool prepare(const Surface& surface, const Grid& grid, Threads threads,
               const mesh::Context& context);
  bool walk(Threads threads, const mesh::Context& context);
  bool traverse(const mesh::Context& context);
  void put_in_order();
  std::vector<std::byte> stream_of(const Grid& grid, bool has_normals);

  // Predicts values and counts them in a histogram per caller.
  auto predictor(std::size_t histogram) {
    return [this, histogram](std::uint32_t begin, std::uint32_t end) {
      residuals_.predict(order_.corners(), begin, end, histograms_[histogram]);
    };
  }

  Connectivity surface_;
  Opposites opposites_;
  Fans fans_;
  mesh::Buffer<GridPoint> points_;
  Starts starts_;
  Traversal traversal_;
  ValueOrder order_;
  Chunks chunks_;
  Residuals residuals_;
  ResidualCoder coder_;
  NormalCoder normals_;
  std::array<Histogram, 2> histograms_;
};

std::optional<Encoded> Encoder::Stages::encode(const Surface& surface, const Grid& grid,
                                               Threads threads, const mesh::Context& context) {
  const std::array<std::uint64_t, 2> all_vertices = {0, surface.positions.size()};
  const std::array<std::uint64_t, 2> all_triangles = {0, surface.triangles.size()};
  Surface layered = surface;
  if (!has_layers(surface)) {
    layered.layer_vertices = all_vertices;
    layered.layer_triangles = all_triangles;
  }
  if (!connect(layered, threads, context)) return std::nullopt;
  if (!prepare(surface, grid, threads, context)) return std::nullopt;
  if (!walk(threads, context)) return std::nullopt;
  Encoded encoded = {stream_of(grid, !surface.normals.empty()), order_.count(), std::nullopt};
  if (order_.count() == surface_.vertices) {
    encoded.topology = part_topology(surface_, opposites_.boundary(), fans_, traversal_);
  }
  return encoded;
}

bool Encoder::Stages::connect(const Surface& surface, Threads threads,
                              const mesh::Context& context) {
  const std::size_t slabs =
      threads == Threads::kOne ? 1 : static_cast<std::size_t>(mesh::thread_count());
  if (!opposites_.find(surface, slabs, context)) return false;
  const auto faces = static_cast<Face>(surface.triangles.size());
  surface_ = {.words = opposites_.words(),
              .triangles = surface.triangles.data(),
              .faces = faces,
              .vertices = static_cast<Vertex>(surface.positions.size()),
              .none = kWordsPerFace * faces};
  fans_.separate(opposites_.boundary(), surface_);
  return true;
}

// Quantises positions and clears the marks of the traversals.
bool Encoder::Stages::prepare(const Surface& surface, const Grid& grid, Threads threads,
                              const mesh::Context& context) {
  const std::span<const mesh::Vec3> positions = surface.positions;
  if (!surface.normals.empty()) normals_.reserve(surface_.vertices);
  GridPoint* const points = points_.resize_for_overwrite(surface_.vertices);
  constexpr std::size_t kParts = 4;
  std::array<Extent, kParts> extents;
  std::array<bool, kParts> on_grid = {};
  run(threads, context, kParts + 2, [&](std::size_t task) {
    if (task == kParts) return traversal_.prepare(surface_, fans_);
    if (task == kParts + 1) return order_.prepare(surface_, fans_);
    const std::size_t begin = positions.size() * task / kParts;
    const std::size_t end = positions.size() * (task + 1) / kParts;
    on_grid[task] =
        quantise(positions.subspan(begin, end - begin), grid, points + begin, extents[task]);
    if (!surface.normals.empty()) normals_.quantise(surface.normals, begin, end);
  });
  if (std::ranges::count(on_grid, false) != 0) return false;
  for (std::size_t i = 0; i < fans_.originals().size(); ++i) {
    points[positions.size() + i] = points[fans_.originals()[i]];
    if (!surface.normals.empty()) normals_.copy(fans_.originals()[i], positions.size() + i);
  }
  Extent extent = extents[0];
  for (const Extent& other : extents) extent.cover(other);
  residuals_.prepare(surface_, points, extent);
  for (Histogram& histogram : histograms_) histogram.reset(residuals_.wrap().symbols());
  starts_.reset(surface_.faces);
  chunks_.reset();
  return true;
}

// Two traversals; the second follows the first if it can. The first thread to arrive takes the
// first traversal, which waits for nothing, so this ends with any number of threads.
bool Encoder::Stages::walk(Threads threads, const mesh::Context& context) {
  std::atomic<int> come = 0;
  std::atomic<bool> covered = false;
  run(threads, context, 2, [&](std::size_t) {
    if (come.fetch_add(1) == 0) {
      covered = traverse(context);
      if (covered && come.load() == 2) chunks_.help(predictor(1));
    } else {
      put_in_order();
    }
  });
  return covered;
}

bool Encoder::Stages::traverse(const mesh::Context& context) {
  const struct Close {
    ~Close() { starts.close(); }  // also if the traversal was cancelled
    Starts& starts;
  } close{starts_};
  return traversal_.run(fans_, starts_, context);
}

void Encoder::Stages::put_in_order() {
  chunks_.produce(predictor(0), [&](const auto& bring) {
    for (std::uint32_t i = 0;; ++i) {
      const std::optional<Start> start = starts_.get(i);
      if (!start) break;
      order_.add(*start, bring);
    }
  });
}

std::vector<std::byte> Encoder::Stages::stream_of(const Grid& grid, bool has_normals) {
  residuals_.predict_firsts(order_, histograms_[0]);
  std::optional<CodedValues> normals;
  if (has_normals) normals = normals_.code(surface_, order_);
  return assemble({.traversal = traversal_,
                   .faces = surface_.faces,
                   .vertices = order_.count(),
                   .residuals = coder_.code(residuals_, order_, histograms_),
                   .normals = std::move(normals),
                   .extent = residuals_.wrap().extent(),
                   .grid = grid});
}

Encoder::Encoder(std::size_t least_to_look_ahead)
    : stages_(std::make_unique<Stages>(least_to_look_ahead)) {}
Encoder::~Encoder() = default;
Encoder::Encoder(Encoder&&) noexcept = default;
Encoder& Encoder::operator=(Encoder&&) noexcept = default;

std::optional<Encoded> Encoder::encode(const Surface& surface, const Grid& grid, Threads threads,
                                       const mesh::Context& context) {
  context.throw_if_stopped();
  if (!is_covered(surface, grid)) return std::nullopt;
  return stages_->encode(surface, grid, threads, context);
}

}  // namespace isomesh::codec::edgebreaker
