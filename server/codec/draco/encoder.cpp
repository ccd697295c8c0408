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
#include "server/codec/draco/part_topology.h"
#include "server/codec/draco/quantise.h"
#include "server/codec/draco/residual_coder.h"
#include "server/codec/draco/residuals.h"
#include "server/codec/draco/scratch.h"
#include "server/codec/draco/starts.h"
#include "server/codec/draco/stream.h"
#include "server/codec/draco/traversal.h"
#include "server/codec/draco/value_order.h"
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
  Scratch<GridPoint> points_;
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
  GridPoint* const points = points_.reserve(surface_.vertices);
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
  const auto predict = predictor(0);
  for (std::uint32_t i = 0;; ++i) {
    const std::optional<Start> start = starts_.get(i);
    if (!start) break;
    order_.add(*start, [&](std::uint32_t count) { chunks_.bring(count, predict); });
  }
  chunks_.end(predict);
}

std::vector<std::byte> Encoder::Stages::stream_of(const Grid& grid, bool has_normals) {
  residuals_.predict_firsts(order_, histograms_[0]);
  std::optional<CodedNormals> normals;
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
