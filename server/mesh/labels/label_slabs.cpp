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
#include "server/mesh/labels/volume_tally-inl.h"
#include "server/mesh/labels/volume_tally.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

void count_labels(const Separation& separation, const Slab& slab, SurfaceCount& count) {
  if (separation.regularize) return ClusterWalk<LabelClusters>(separation, slab, count).count();
  count_slab_of<LabelField>(separation, slab, count);
}

void tally_labels(const Separation& separation, const Slab& slab,
                  std::span<std::uint64_t> triangles) {
  tally_slab_of(separation, slab, triangles);
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

void tally_volume(const Separation& separation, const Slab& slab, IndexMemory& memory,
                  VolumeTally& tally) {
  if (separation.regularize) {
    return write_slab_of<TallyField<RegularLabelField>>(separation, slab, memory, tally);
  }
  write_slab_of<TallyField<LabelField>>(separation, slab, memory, tally);
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

HWY_EXPORT(count_labels);
HWY_EXPORT(tally_labels);
HWY_EXPORT(write_labels);
HWY_EXPORT(tally_volume);

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

void write_slab(const Separation& separation, const Slab& slab, IndexMemory& memory,
                VolumeTally& tally) {
  HWY_DYNAMIC_DISPATCH(tally_volume)(separation, slab, memory, tally);
}

}  // namespace isomesh::mesh
#endif
