#include "server/mesh/labels/separate.h"

#include "server/mesh/extract/slab_passes.h"
#include "server/mesh/labels/label_slabs.h"

namespace isomesh::mesh {
namespace {

bool has_walls(const Dims& dims, const SeparateOptions& options) {
  scheme_of_labels(options.scheme);
  return dims.has_cells() && !options.labels.empty();
}

void tally_all(const Separation& separation, const Context& context,
               std::vector<std::uint64_t>& triangles) {
  const auto slabs = cut_slabs(separation.dims.z, [](std::uint32_t z) { return z; });
  std::vector<std::vector<std::uint64_t>> parts(slabs.size());
  parallel_for(context, slabs.size(), [&](std::size_t task) {
    parts[task].assign(triangles.size(), 0);
    tally_slab(separation, slabs[task], std::span(parts[task]));
  });
  for (const std::vector<std::uint64_t>& part : parts) {
    for (std::size_t n = 0; n < part.size(); ++n) triangles[n] += part[n];
  }
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
                                                 const Context& context) {
  std::vector<std::uint64_t> triangles(options.labels.size() + 1, 0);
  if (!has_walls(lattice.dims, options)) {
    context.throw_if_stopped();
    return triangles;
  }
  tally_all(Separation(lattice, options), context, triangles);
  return triangles;
}

template <class T>
void extract_walls(const Lattice<T>& lattice, const SeparateOptions& options,
                   const SurfaceCount& count, const Context& context, SeparatingSurface& surface) {
  Mesh& mesh = surface.mesh;
  make_room(count, lattice.to_space, options.close, mesh);
  mesh.on_line.assign((count.vertices() + kFlagBits - 1) / kFlagBits, 0);
  surface.sides.resize_for_overwrite(count.triangles());
  surface.owners.resize_for_overwrite(count.vertices());
  surface.labels = options.labels;
  surface.parts = LabelParts(options.labels, options.values);
  if (count.vertices() == 0) return context.throw_if_stopped();

  Separation separation(lattice, options);
  separation.clusters = count.clusters;
  write_pass(separation, kSlotPlaces, context, surface.mesh, surface);
}

#define ISOMESH_INSTANTIATE(T)                                                                  \
  template SurfaceCount count_walls(const Lattice<T>&, const SeparateOptions&, const Context&); \
  template std::vector<std::uint64_t> count_label_triangles(                                    \
      const Lattice<T>&, const SeparateOptions&, const Context&);                               \
  template void extract_walls(const Lattice<T>&, const SeparateOptions&, const SurfaceCount&,   \
                              const Context&, SeparatingSurface&);
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
