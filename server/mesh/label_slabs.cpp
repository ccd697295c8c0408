// As slabs.cpp, for labels.
#include "server/mesh/label_slabs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/label_slabs.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/mesh/labels-inl.h"
#include "server/mesh/slab_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

#define ISOMESH_FOR_TYPE(T, Name)                                                                  \
  void count_labels_##Name(const Separation<T>& separation, const Slab& slab,                      \
                           SurfaceCount& count) {                                                  \
    count_slab_of<LabelField<T>>(separation, slab, count);                                         \
  }                                                                                                \
  void tally_labels_##Name(const Separation<T>& separation, const Slab& slab,                      \
                           std::span<std::uint64_t> triangles) {                                   \
    tally_slab_of<T>(separation, slab, triangles);                                                 \
  }                                                                                                \
  void write_labels_##Name(const Separation<T>& separation, const Slab& slab, IndexMemory& memory, \
                           SeparatingSurface& surface) {                                           \
    write_slab_of<LabelField<T>>(separation, slab, memory, surface);                               \
  }
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_FOR_TYPE)
#undef ISOMESH_FOR_TYPE

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

#define ISOMESH_DISPATCH(T, Name)                                                           \
  HWY_EXPORT(count_labels_##Name);                                                          \
  HWY_EXPORT(tally_labels_##Name);                                                          \
  HWY_EXPORT(write_labels_##Name);                                                          \
  template <>                                                                               \
  void count_slab(const Separation<T>& separation, const Slab& slab, SurfaceCount& count) { \
    HWY_DYNAMIC_DISPATCH(count_labels_##Name)(separation, slab, count);                     \
  }                                                                                         \
  template <>                                                                               \
  void tally_slab(const Separation<T>& separation, const Slab& slab,                        \
                  std::span<std::uint64_t> triangles) {                                     \
    HWY_DYNAMIC_DISPATCH(tally_labels_##Name)(separation, slab, triangles);                 \
  }                                                                                         \
  template <>                                                                               \
  void write_slab(const Separation<T>& separation, const Slab& slab, IndexMemory& memory,   \
                  SeparatingSurface& surface) {                                             \
    HWY_DYNAMIC_DISPATCH(write_labels_##Name)(separation, slab, memory, surface);           \
  }
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_DISPATCH)
#undef ISOMESH_DISPATCH

}  // namespace isomesh::mesh
#endif
