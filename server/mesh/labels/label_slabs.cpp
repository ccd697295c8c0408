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
#include "server/mesh/labels/label_writer-inl.h"
#include "server/mesh/labels/labels-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

void count_labels(const Separation& separation, const Slab& slab, SurfaceCount& count) {
  if (separation.regularize) return ClusterWalk<LabelClusters>(separation, slab, count).count();
  count_slab_of<LabelField>(separation, slab, count);
}

void write_labels(const Separation& separation, const Slab& slab, IndexMemory& memory,
                  SeparatingSurface& surface) {
  write_slab_of<LabelWriter>(separation, slab, memory, surface);
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

HWY_EXPORT(count_labels);
HWY_EXPORT(write_labels);

void count_slab(const Separation& separation, const Slab& slab, SurfaceCount& count) {
  HWY_DYNAMIC_DISPATCH(count_labels)(separation, slab, count);
}

void write_slab(const Separation& separation, const Slab& slab, IndexMemory& memory,
                SeparatingSurface& surface) {
  HWY_DYNAMIC_DISPATCH(write_labels)(separation, slab, memory, surface);
}

}  // namespace isomesh::mesh
#endif
