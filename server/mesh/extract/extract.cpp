#include "server/mesh/extract/extract.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "proto/samples.h"
#include "server/mesh/extract/joined_layers.h"
#include "server/mesh/extract/open_cavities.h"
#include "server/mesh/extract/slab_passes.h"
#include "server/mesh/extract/windows.h"
#include "server/mesh/lattice/bcc_faces.h"

namespace isomesh::mesh {
namespace {

// The smallest value of T that is at least `iso`; empty if there is none.
template <class T>
std::optional<T> smallest_from(double iso) {
  constexpr auto kLowest = static_cast<double>(std::numeric_limits<T>::lowest());
  if (iso > static_cast<double>(std::numeric_limits<T>::max())) return std::nullopt;
  if constexpr (std::is_integral_v<T>) {
    return static_cast<T>(std::ceil(std::max(iso, kLowest)));
  } else {
    const auto nearest = static_cast<T>(std::max(iso, kLowest));
    return static_cast<double>(nearest) >= iso
               ? nearest
               : std::nextafter(nearest, std::numeric_limits<T>::infinity());
  }
}

// The largest value of T that is below `iso`; empty if there is none.
template <class T>
std::optional<T> largest_below(double iso) {
  constexpr auto kMost = static_cast<double>(std::numeric_limits<T>::max());
  if (iso <= static_cast<double>(std::numeric_limits<T>::lowest())) return std::nullopt;
  if constexpr (std::is_integral_v<T>) {
    return static_cast<T>(std::min(std::ceil(iso) - 1, kMost));
  } else {
    const auto nearest = static_cast<T>(std::min(iso, kMost));
    return static_cast<double>(nearest) < iso
               ? nearest
               : std::nextafter(nearest, -std::numeric_limits<T>::infinity());
  }
}

// Empty when no value of T is inside.
template <class T>
std::optional<Threshold<T>> threshold_of(const ExtractOptions& options) {
  const bool is_above = options.inside == Inside::kAbove;
  const auto limit = is_above ? smallest_from<T>(options.iso) : largest_below<T>(options.iso);
  if (!limit) return std::nullopt;
  return Threshold<T>{*limit, options.inside};
}

std::size_t places_of(Scheme scheme) { return scheme == Scheme::kBcc ? kBccPlaces : kEdgePlaces; }

}  // namespace

// A left-handed lattice turns the tables' triangles inside out.
std::array<CellSplit, 2> splits_of(Scheme scheme, bool left_handed) {
  std::array splits = {cell_split(scheme, false), cell_split(scheme, true)};
  if (left_handed) {
    for (CellSplit& split : splits) {
      for (CellCase& cell : split.cases) {
        for (auto& [a, b, c] : cell.edges) std::swap(b, c);
      }
    }
  }
  return splits;
}

void make_room(const SurfaceCount& count, const LatticeToSpace& to_space, bool close, Mesh& mesh) {
  constexpr std::uint64_t kMostVertices = std::numeric_limits<std::uint32_t>::max();
  if (count.vertices() > kMostVertices) {
    throw Error(ErrorCode::kTooLarge, "the surface has " + std::to_string(count.vertices()) +
                                          " vertices; more than " + std::to_string(kMostVertices) +
                                          " cannot be indexed with 32 bits");
  }
  mesh.origin = to_space.origin;
  mesh.reach = {};
  mesh.layer_vertices = count.layer_vertices;
  mesh.layer_triangles = count.layer_triangles;
  mesh.positions.resize_for_overwrite(count.vertices());
  mesh.triangles.resize_for_overwrite(count.triangles());
  mesh.kept.clear();
  mesh.on_border.assign(close ? (count.vertices() + kFlagBits - 1) / kFlagBits : 0, 0);
  mesh.on_line.clear();
  mesh.normals.clear();
}

Reach reach_of(std::span<const CrossedRows> layers, const LatticeToSpace& to_space) {
  CrossedRows all;
  for (const CrossedRows& layer : layers) all.add(layer);
  if (all.is_empty()) return {};
  // An edge between two centres ends one and a half steps beyond its sample.
  constexpr double kBefore = -1;
  constexpr double kBehind = 2.5;
  Reach reach;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double low = all.low[axis];
    double high = all.high[axis];
    for (const std::array<double, 3>& step : {to_space.step_x, to_space.step_y, to_space.step_z}) {
      low += std::min(step[axis] * kBefore, step[axis] * kBehind);
      high += std::max(step[axis] * kBefore, step[axis] * kBehind);
    }
    reach.low[axis] = static_cast<float>(low);
    reach.high[axis] = static_cast<float>(high);
  }
  return reach;
}

SurfaceSize size_of(const SurfaceCount& count) {
  SurfaceSize size = {.triangles = count.triangles(),
                      .vertices = count.vertices(),
                      .layers = count.layer_vertices.size() - 1};
  for (std::size_t i = 0; i < size.largest_runs.size(); ++i) {
    for (std::size_t k = 0; k < size.layers; ++k) {
      const std::size_t end = std::min<std::size_t>(size.layers, k + i + 1);
      size.largest_runs[i] =
          std::max(size.largest_runs[i], count.layer_vertices[end] - count.layer_vertices[k]);
    }
  }
  return size;
}

std::uint64_t SurfaceSize::most_vertices(std::uint64_t in_layers) const {
  const std::uint64_t longest = largest_runs.size();
  const std::uint64_t rest = in_layers % longest;
  const std::uint64_t sum =
      in_layers / longest * largest_runs.back() + (rest > 0 ? largest_runs[rest - 1] : 0);
  return std::min(sum, vertices);
}

template <class T>
SurfaceWindows::SurfaceWindows(const Lattice<T>& lattice, const ExtractOptions& options,
                               const Context& context, Spool* spool)
    : close_(options.close),
      to_space_(lattice.to_space),
      count_(empty_count(marched_dims(lattice.dims, options.close).z)),
      joined_(std::make_unique<JoinedLayers>(count_.clusters, spool)) {
  const auto threshold = threshold_of<T>(options);
  context.throw_if_stopped();
  if (!lattice.dims.has_cells() || !threshold) return;
  extraction_ = std::make_unique<Extraction>(lattice, options, *threshold);
  if (options.regularize) count_.clusters.resize(extraction_->dims.z);
  joined_->prepare();
  count_pass(*extraction_, context, count_, [&](std::uint32_t z) { joined_->put_aside(z); });
  prefix_pass(count_);
  if (options.regularize) extraction_->keep(count_.clusters);
  memory_ = std::make_unique<IndexMemory>(
      index_memory_size(extraction_->dims, places_of(options.scheme)));
}

SurfaceWindows::~SurfaceWindows() = default;

template <class T>
SurfaceCount count_surface(const Lattice<T>& lattice, const ExtractOptions& options,
                           const Context& context) {
  return SurfaceWindows(lattice, options, context).take_count();
}

template <class T>
SignRows sign_rows(const Lattice<T>& lattice, const ExtractOptions& options) {
  SignRows signs = {.dims = lattice.dims, .classify = {}};
  const auto threshold = threshold_of<T>(options);
  if (!threshold) return signs;
  ExtractOptions open = options;
  open.close = false;
  const std::shared_ptr<const SampleRows> rows = make_sample_rows(lattice, open, *threshold);
  signs.classify = [rows](std::uint32_t y, std::uint32_t z, std::uint64_t* out) {
    rows->classify(y, z, out);
  };
  signs.add_centres = [rows](std::uint32_t y, std::uint32_t z,
                             std::span<const std::uint64_t> uncertain,
                             std::uint64_t* out) { rows->add_centres(y, z, 0, uncertain, out); };
  return signs;
}

void SurfaceWindows::write(std::uint32_t begin, std::uint32_t end, Mesh& mesh) {
  mesh.origin = to_space_.origin;
  const auto offsets = [&](const std::vector<std::uint64_t>& sums, std::uint32_t behind,
                           std::vector<std::uint64_t>& out) {
    out.clear();
    for (std::uint32_t z = begin; z <= end; ++z) out.push_back(sums[z] - sums[begin]);
    out.push_back(sums[behind] - sums[begin]);
  };
  offsets(count_.layer_vertices, std::min(end + 1, layers()), mesh.layer_vertices);
  offsets(count_.layer_triangles, end, mesh.layer_triangles);
  const std::uint64_t vertices = mesh.layer_vertices.back();
  mesh.positions.resize_for_overwrite(vertices);
  mesh.triangles.resize_for_overwrite(mesh.layer_triangles.back());
  mesh.on_border.assign(close_ ? (vertices + kFlagBits - 1) / kFlagBits : 0, 0);
  if (!extraction_) return;
  joined_->take_back(begin, end + kJoinedLayersBehind);
  write_slab(*extraction_, {begin, end, begin}, *memory_, mesh);
}

void SurfaceWindows::write_whole(const Context& context, Mesh& mesh) {
  make_room(count_, to_space_, close_, mesh);
  context.throw_if_stopped();
  if (count_.vertices() == 0) return;
  mesh.reach = reach();
  joined_->take_back(0, layers());
  write_pass(*extraction_, places_of(extraction_->scheme), context, mesh, mesh);
}

WritingMemory writing_memory(const ExtractOptions& options, std::uint64_t plane_samples) {
  // The codes of cells, signs, and rows around the plane.
  constexpr std::uint64_t kOfCells = 4;
  // Measured: 10.4 bytes on an average.
  constexpr std::uint64_t kJoinedPerVertex = 12;
  // Two bits for each edge that clusters may have, of two planes (joined_edges-inl.h).
  const std::uint64_t of_joined = options.scheme == Scheme::kBcc ? 8 : 4;
  const std::uint64_t indices = places_of(options.scheme) * sizeof(std::uint32_t);
  const std::uint64_t plain = plane_samples * (indices + kOfCells);
  if (!options.regularize) return {plain, 0};
  return {plain + plane_samples * of_joined, kJoinedPerVertex};
}

void SurfaceWindows::forget(std::uint32_t begin, std::uint32_t end) { joined_->forget(begin, end); }

#define ISOMESH_INSTANTIATE(T, name, kType)                                                      \
  template SurfaceWindows::SurfaceWindows(const Lattice<T>&, const ExtractOptions&,              \
                                          const Context&, Spool*);                               \
  template SurfaceCount count_surface(const Lattice<T>&, const ExtractOptions&, const Context&); \
  template SignRows sign_rows(const Lattice<T>&, const ExtractOptions&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
