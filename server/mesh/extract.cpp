#include "server/mesh/extract.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "proto/samples.h"
#include "server/mesh/parallel.h"
#include "server/mesh/slabs.h"

namespace isomesh::mesh {
namespace {

// The smallest value of T that is inside, so that classifying compares T with T. Empty when no
// value of T is inside.
template <class T>
std::optional<T> smallest_inside(double iso) {
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

// Cuts the layers into runs of about equal cost; `cost(k)` is the running cost up to layer k.
template <class RunningCost>
std::vector<Slab> cut_slabs(std::uint32_t layers, RunningCost cost) {
  // Enough slabs that the threads end together, few enough that the plane which two slabs both
  // number costs little.
  const auto slabs = static_cast<std::size_t>(thread_count()) * 6;
  const double step = static_cast<double>(cost(layers)) / static_cast<double>(slabs);
  std::vector<Slab> result;
  std::uint32_t begin = 0;
  for (std::uint32_t end = 1; end <= layers; ++end) {
    const double goal = step * static_cast<double>(result.size() + 1);
    if (end < layers && static_cast<double>(cost(end)) < goal) continue;
    result.push_back({begin, end});
    begin = end;
  }
  return result;
}

// Pass 1: how many vertices and triangles each layer has, in the place behind the layer's.
template <class T>
void count_pass(const Extraction<T>& extraction, const Context& context, SurfaceCount& count) {
  const auto slabs = cut_slabs(extraction.dims.z, [](std::uint32_t z) { return z; });
  parallel_for(context, slabs.size(),
               [&](std::size_t task) { count_slab(extraction, slabs[task], count); });
}

// Pass 2: where each layer begins.
void prefix_pass(SurfaceCount& count) {
  for (auto* sums : {&count.layer_vertices, &count.layer_triangles}) {
    std::partial_sum(sums->begin(), sums->end(), sums->begin());
  }
}

// Pass 3: every vertex and triangle to its place, which the mesh's layers tell.
template <class T>
void write_pass(const Extraction<T>& extraction, const Context& context, Mesh& mesh) {
  const Dims& dims = extraction.dims;
  IndexMemory memory(index_memory_size(dims));
  // A layer costs its triangles, and its samples even when it is empty.
  const std::uint64_t samples_cost = std::uint64_t{dims.x} * dims.y / 16;
  const auto slabs = cut_slabs(
      dims.z, [&](std::uint32_t z) { return mesh.layer_triangles[z] + z * samples_cost; });
  parallel_for(context, slabs.size(),
               [&](std::size_t task) { write_slab(extraction, slabs[task], memory, mesh); });
}

}  // namespace

SurfaceSize size_of(const SurfaceCount& count) {
  SurfaceSize size = {.triangles = count.triangles(),
                      .vertices = count.vertices(),
                      .layers = count.layer_vertices.size() - 1};
  for (std::size_t k = 0; k < size.layers; ++k) {
    size.largest_layer =
        std::max(size.largest_layer, count.layer_vertices[k + 1] - count.layer_vertices[k]);
  }
  return size;
}

template <class T>
Extraction<T>::Extraction(const Lattice<T>& the_lattice, const ExtractOptions& options,
                          T the_smallest)
    : lattice(the_lattice),
      margin(margin_of(options)),
      dims(marched_dims(the_lattice.dims, options)),
      scheme(options.scheme),
      smallest(the_smallest),
      placement(options, the_lattice.dims, the_lattice.to_space),
      splits(splits_of(options.scheme, the_lattice.to_space.determinant() < 0)) {
  if (options.close) border.emplace(the_lattice, options, the_smallest, placement);
}

template <class T>
SurfaceCount count_surface(const Lattice<T>& lattice, const ExtractOptions& options,
                           const Context& context) {
  const std::uint32_t layers = marched_dims(lattice.dims, options).z;
  SurfaceCount count;
  count.layer_vertices.assign(std::size_t{layers} + 1, 0);
  count.layer_triangles.assign(std::size_t{layers} + 1, 0);
  const auto smallest = smallest_inside<T>(options.iso);
  if (!lattice.dims.has_cells() || !smallest) {
    context.throw_if_stopped();
    return count;
  }

  const Extraction<T> extraction(lattice, options, *smallest);
  count_pass(extraction, context, count);
  prefix_pass(count);
  return count;
}

template <class T>
void extract_surface(const Lattice<T>& lattice, const ExtractOptions& options,
                     const SurfaceCount& count, const Context& context, Mesh& mesh) {
  constexpr std::uint64_t kMostVertices = std::numeric_limits<std::uint32_t>::max();
  if (count.vertices() > kMostVertices) {
    throw Error(ErrorCode::kTooLarge, "the surface has " + std::to_string(count.vertices()) +
                                          " vertices; more than " + std::to_string(kMostVertices) +
                                          " cannot be indexed with 32 bits");
  }
  mesh.origin = lattice.to_space.origin;
  mesh.layer_vertices = count.layer_vertices;
  mesh.layer_triangles = count.layer_triangles;
  mesh.positions.resize_for_overwrite(count.vertices());
  mesh.triangles.resize_for_overwrite(count.triangles());
  mesh.on_border.assign(options.close ? (count.vertices() + kFlagBits - 1) / kFlagBits : 0, 0);
  const auto smallest = smallest_inside<T>(options.iso);
  if (!lattice.dims.has_cells() || !smallest || count.vertices() == 0) {
    return context.throw_if_stopped();
  }

  write_pass(Extraction<T>(lattice, options, *smallest), context, mesh);
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                                      \
  template SurfaceCount count_surface(const Lattice<T>&, const ExtractOptions&, const Context&); \
  template void extract_surface(const Lattice<T>&, const ExtractOptions&, const SurfaceCount&,   \
                                const Context&, Mesh&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
