// The passes over slabs of labels, compiled like slabs.cpp.
#include "server/mesh/labels/label_slabs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/labels/label_slabs.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/extract/clusters-inl.h"
#include "server/mesh/extract/slab_passes.h"
#include "server/mesh/extract/slab_walk-inl.h"
#include "server/mesh/labels/label_clusters-inl.h"
#include "server/mesh/labels/labels-inl.h"
#include "server/mesh/labels/regular_labels-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

void count_labels(const Separation& separation, const Slab& slab, SurfaceCount& count) {
  if (separation.regularize) return ClusterWalk<LabelClusters>(separation, slab, count).count();
  count_slab_of<LabelField>(separation, slab, count);
}

// Adds to the place of each label's number how many triangles its own surface has in the slab.
static void tally_plain(const Separation& separation, const Slab& slab,
                        std::span<std::uint64_t> triangles) {
  LabelField field(separation, slab.begin);
  const std::size_t words = words_of(separation.dims.x);
  LabelCells cells;
  for (std::uint32_t z = slab.begin; z < slab.end; ++z) {
    field.reach(z);
    for (std::uint32_t y = 0; y < separation.dims.y; ++y) {
      const LabelRow row = field.row(y, z);
      for (std::size_t w = 0; w < words; ++w) {
        if (!row.may_cross(w)) continue;
        row.describe(w, cells);
        row.visit_walls(w, cells, [&](PartNumber a, PartNumber b, unsigned count) {
          separation.parts.visit_labels(
              a, b, [&](std::size_t label, bool) { triangles[label] += count; });
        });
      }
    }
  }
}

void tally_labels(const Separation& separation, const Slab& slab,
                  std::span<std::uint64_t> triangles) {
  tally_plain(separation, slab, triangles);
  if (!separation.regularize) return;
  // A sample's clusters take triangles from two layers, so a part of this may be less than zero;
  // the sum of all parts is not.
  SurfaceCount count = empty_count(separation.dims.z);
  count.clusters.resize(separation.dims.z);
  ClusterWalk<LabelClusters> walk(separation, slab, count);
  walk.rule().tally_into(triangles);
  walk.count();
}

void write_labels(const Separation& separation, const Slab& slab, IndexMemory& memory,
                  SeparatingSurface& surface) {
  if (separation.regularize) {
    return write_slab_of<RegularLabelField>(separation, slab, memory, surface);
  }
  write_slab_of<LabelField>(separation, slab, memory, surface);
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

HWY_EXPORT(count_labels);
HWY_EXPORT(tally_labels);
HWY_EXPORT(write_labels);

void count_slab(const Separation& separation, const Slab& slab, SurfaceCount& count) {
  HWY_DYNAMIC_DISPATCH(count_labels)(separation, slab, count);
}

void tally_slab(const Separation& separation, const Slab& slab,
                std::span<std::uint64_t> triangles) {
  HWY_DYNAMIC_DISPATCH(tally_labels)(separation, slab, triangles);
}

void write_slab(const Separation& separation, const Slab& slab, IndexMemory& memory,
                SeparatingSurface& surface) {
  HWY_DYNAMIC_DISPATCH(write_labels)(separation, slab, memory, surface);
}

}  // namespace isomesh::mesh
#endif
