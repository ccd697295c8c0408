#include "server/mesh/separate.h"

#include "server/mesh/label_slabs.h"
#include "server/mesh/slab_passes.h"

namespace isomesh::mesh {

template <class T>
SurfaceCount count_walls(const Lattice<T>& lattice, const SeparateOptions& options,
                         const Context& context) {
  SurfaceCount count = empty_count(marched_dims(lattice.dims, options.close).z);
  if (!lattice.dims.has_cells() || options.labels.empty()) {
    context.throw_if_stopped();
    return count;
  }

  const Separation<T> separation(lattice, options);
  count_pass(separation, context, count);
  prefix_pass(count);
  return count;
}

template <class T>
std::vector<std::uint64_t> count_label_triangles(const Lattice<T>& lattice,
                                                 const SeparateOptions& options,
                                                 const Context& context) {
  std::vector<std::uint64_t> triangles(options.labels.size() + 1, 0);
  if (!lattice.dims.has_cells() || options.labels.empty()) {
    context.throw_if_stopped();
    return triangles;
  }

  const Separation<T> separation(lattice, options);
  const auto slabs = cut_slabs(separation.dims.z, [](std::uint32_t z) { return z; });
  std::vector<std::vector<std::uint64_t>> parts(slabs.size());
  parallel_for(context, slabs.size(), [&](std::size_t task) {
    parts[task].assign(triangles.size(), 0);
    tally_slab(separation, slabs[task], std::span(parts[task]));
  });
  for (const std::vector<std::uint64_t>& part : parts) {
    for (std::size_t n = 0; n < part.size(); ++n) triangles[n] += part[n];
  }
  return triangles;
}

template <class T>
void extract_walls(const Lattice<T>& lattice, const SeparateOptions& options,
                   const SurfaceCount& count, const Context& context, SeparatingSurface& surface) {
  Mesh& mesh = surface.mesh;
  make_room(count, lattice.to_space, options.close, mesh);
  mesh.on_line.assign((count.vertices() + kFlagBits - 1) / kFlagBits, 0);
  surface.sides.resize_for_overwrite(count.triangles());
  surface.labels = options.labels;
  surface.parts = LabelParts(options.labels, options.values);
  if (count.vertices() == 0) return context.throw_if_stopped();

  write_pass(Separation<T>(lattice, options), kSlotPlaces, context, mesh, surface);
}

#define ISOMESH_INSTANTIATE(T, name)                                                            \
  template SurfaceCount count_walls(const Lattice<T>&, const SeparateOptions&, const Context&); \
  template std::vector<std::uint64_t> count_label_triangles(                                    \
      const Lattice<T>&, const SeparateOptions&, const Context&);                               \
  template void extract_walls(const Lattice<T>&, const SeparateOptions&, const SurfaceCount&,   \
                              const Context&, SeparatingSurface&);
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
