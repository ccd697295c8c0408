#include "server/jobs/memory.h"

#include <malloc.h>

namespace isomesh::jobs {

void keep_freed_memory() {
  constexpr int kLargestBlockBytes = 32 << 20;  // the most that the C library allows
  constexpr int kKeptBytes = 256 << 20;
  ::mallopt(M_MMAP_THRESHOLD, kLargestBlockBytes);
  ::mallopt(M_TRIM_THRESHOLD, kKeptBytes);
}

}  // namespace isomesh::jobs
