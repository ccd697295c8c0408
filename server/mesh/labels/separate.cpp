#include "server/mesh/labels/separate.h"

#include <algorithm>

#include "base/mutex.h"
#include "server/mesh/extract/slab_passes.h"
#include "server/mesh/labels/label_slabs.h"

namespace isomesh::mesh {
namespace {

bool has_walls(const Dims& dims, const SeparateOptions& options) {
  scheme_of_labels(options.scheme);
  return dims.has_cells() && !options.labels.empty();
}

void make_room_for_walls(const SurfaceCount& count, const LatticeToSpace& to_space, bool close,
                         SeparatingSurface& surface) {
  make_room(count, to_space, close, surface.mesh);
  surface.mesh.on_line.assign((count.vertices() + kFlagBits - 1) / kFlagBits, 0);
  surface.sides.resize_for_overwrite(count.triangles());
  surface.owners.resize_for_overwrite(count.vertices());
}

// As if there were nothing in other layers than [begin, end).
SurfaceCount count_within(const SurfaceCount& count, std::size_t begin, std::size_t end) {
  const auto within = [&](std::vector<std::uint64_t> sums) {
    const std::uint64_t first = sums[begin];
    const std::uint64_t last = sums[end];
    for (std::uint64_t& sum : sums) sum = std::clamp(sum, first, last) - first;
    return sums;
  };
  SurfaceCount part;
  part.layer_vertices = within(count.layer_vertices);
  part.layer_triangles = within(count.layer_triangles);
  return part;
}

}  // namespace

Scheme scheme_of_labels(Scheme scheme) {
  if (scheme == Scheme::kFive || scheme == Scheme::kSix) return scheme;
  throw Error(ErrorCode::kInvalidParameter,
              "labels cannot be extracted with scheme bcc; use 5 or 6");
}

template <class T>
SurfaceCount count_walls(const Lattice<T>& lattice, const SeparateOptions& options,
                         const Context& context) {
  SurfaceCount count = empty_count(marched_dims(lattice.dims, options.close).z);
  if (!has_walls(lattice.dims, options)) {
    context.throw_if_stopped();
    return count;
  }
  const Separation separation(lattice, options);
  if (options.regularize) count.clusters.resize(separation.dims.z);
  count_pass(separation, context, count);
  prefix_pass(count);
  return count;
}

template <class T>
std::vector<std::uint64_t> count_label_triangles(const Lattice<T>& lattice,
                                                 const SeparateOptions& options,
                                                 const SurfaceCount& count,
                                                 const Context& context) {
  constexpr std::size_t kLayersAtOnce = 8;
  std::vector<std::uint64_t> triangles(options.labels.size() + 1, 0);
  if (count.triangles() == 0) return triangles;
  Separation separation(lattice, options);
  separation.clusters = count.clusters;
  IndexMemory memory(index_memory_size(separation.dims, kSlotPlaces));
  Mutex mutex;
  const auto count_layers = [&](std::size_t begin, std::size_t end) {
    SeparatingSurface part;
    make_room_for_walls(count_within(count, begin, end), lattice.to_space, options.close, part);
    const Slab slab = {static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end)};
    write_slab(separation, slab, memory, part);
    const Lock lock(mutex);
    for (const auto& [front, back] : part.sides) {
      separation.parts.visit_labels(front, back,
                                    [&](std::size_t label, bool) { ++triangles[label]; });
    }
  };
  for_chunks(context, separation.dims.z, count_layers, kLayersAtOnce);
  return triangles;
}

template <class T>
void extract_walls(const Lattice<T>& lattice, const SeparateOptions& options,
                   const SurfaceCount& count, const Context& context, SeparatingSurface& surface) {
  make_room_for_walls(count, lattice.to_space, options.close, surface);
  surface.labels = options.labels;
  surface.parts = LabelParts(options.labels, options.values);
  if (count.vertices() == 0) return context.throw_if_stopped();

  Separation separation(lattice, options);
  separation.clusters = count.clusters;
  write_pass(separation, kSlotPlaces, context, surface.mesh, surface);
}

std::uint64_t wall_writing_memory(std::uint64_t plane_samples) {
  // The numbers of parts, the codes of cells, and what is joined, with rows around the plane.
  constexpr std::uint64_t kBesideIndices = 16;
  return plane_samples * (kSlotPlaces * sizeof(std::uint32_t) + kBesideIndices);
}

#define ISOMESH_INSTANTIATE(T)                                                                  \
  template SurfaceCount count_walls(const Lattice<T>&, const SeparateOptions&, const Context&); \
  template std::vector<std::uint64_t> count_label_triangles(                                    \
      const Lattice<T>&, const SeparateOptions&, const SurfaceCount&, const Context&);          \
  template void extract_walls(const Lattice<T>&, const SeparateOptions&, const SurfaceCount&,   \
                              const Context&, SeparatingSurface&);
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
