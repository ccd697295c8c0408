// The code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE is compiled once for each
// instruction set: this file includes itself through Highway's foreach_target.h. No vector types
// are needed here; what gains is what the compiler makes of 64-bit counts, shifts and four-lane
// positions.
#include "server/mesh/extract/slabs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/extract/slabs.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "proto/samples.h"
#include "server/mesh/extract/signs-inl.h"
#include "server/mesh/extract/slab_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// Highway's tables hold functions, not templates.
#define ISOMESH_FOR_TYPE(T, Name, kType)                                                           \
  void count_slab_##Name(const Extraction<T>& extraction, const Slab& slab, SurfaceCount& count) { \
    count_slab_of<SignField<T>>(extraction, slab, count);                                          \
  }                                                                                                \
  void write_slab_##Name(const Extraction<T>& extraction, const Slab& slab, IndexMemory& memory,   \
                         Mesh& mesh) {                                                             \
    write_slab_of<SignField<T>>(extraction, slab, memory, mesh);                                   \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_FOR_TYPE)
#undef ISOMESH_FOR_TYPE

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

#define ISOMESH_DISPATCH(T, Name, kType)                                                    \
  HWY_EXPORT(count_slab_##Name);                                                            \
  HWY_EXPORT(write_slab_##Name);                                                            \
  template <>                                                                               \
  void count_slab(const Extraction<T>& extraction, const Slab& slab, SurfaceCount& count) { \
    HWY_DYNAMIC_DISPATCH(count_slab_##Name)(extraction, slab, count);                       \
  }                                                                                         \
  template <>                                                                               \
  void write_slab(const Extraction<T>& extraction, const Slab& slab, IndexMemory& memory,   \
                  Mesh& mesh) {                                                             \
    HWY_DYNAMIC_DISPATCH(write_slab_##Name)(extraction, slab, memory, mesh);                \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_DISPATCH)
#undef ISOMESH_DISPATCH

}  // namespace isomesh::mesh
#endif
