// The code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE is compiled once for each
// instruction set: this file includes itself through Highway's foreach_target.h. No vector types
// are needed here; what gains is what the compiler makes of 64-bit counts, shifts and four-lane
// positions.
#include "server/mesh/extract/slabs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/extract/slabs.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/extract/bcc_clusters-inl.h"
#include "server/mesh/extract/bcc_field-inl.h"
#include "server/mesh/extract/regular-inl.h"
#include "server/mesh/extract/sign_clusters-inl.h"
#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slab_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

void count_signs(const Extraction& extraction, const Slab& slab, SurfaceCount& count,
                 const LayerEnded& ended) {
  const bool is_bcc = extraction.scheme == Scheme::kBcc;
  if (extraction.regularize) {
    return is_bcc ? ClusterWalk<BccClusters>(extraction, slab, count).count(ended)
                  : ClusterWalk<SignClusters>(extraction, slab, count).count(ended);
  }
  is_bcc ? count_slab_of<BccField>(extraction, slab, count)
         : count_slab_of<SignField>(extraction, slab, count);
}

void write_signs(const Extraction& extraction, const Slab& slab, IndexMemory& memory, Mesh& mesh) {
  const bool is_bcc = extraction.scheme == Scheme::kBcc;
  if (extraction.regularize) {
    return is_bcc ? write_slab_of<RegularBccField>(extraction, slab, memory, mesh)
                  : write_slab_of<RegularField>(extraction, slab, memory, mesh);
  }
  is_bcc ? write_slab_of<BccField>(extraction, slab, memory, mesh)
         : write_slab_of<SignField>(extraction, slab, memory, mesh);
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

HWY_EXPORT(count_signs);
HWY_EXPORT(write_signs);

void count_slab(const Extraction& extraction, const Slab& slab, SurfaceCount& count,
                const LayerEnded& ended) {
  HWY_DYNAMIC_DISPATCH(count_signs)(extraction, slab, count, ended);
}

void write_slab(const Extraction& extraction, const Slab& slab, IndexMemory& memory, Mesh& mesh) {
  HWY_DYNAMIC_DISPATCH(write_signs)(extraction, slab, memory, mesh);
}

}  // namespace isomesh::mesh
#endif
