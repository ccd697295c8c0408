// A pool of Draco encoders with their memory. Private to this folder.
#pragma once

#include <memory>
#include <vector>

#include "base/mutex.h"
#include "server/codec/draco_chunk.h"

namespace isomesh::codec {

// Fresh memory costs a fifth of the encoding time, so encoders outlive jobs, as the workers' meshes
// do. Thread safe.
class Encoders {
 public:
  // The process's pool. Idle encoders have together encoded at most kMostIdleTriangles at once,
  // about 250 MiB.
  static Encoders& instance();
  static constexpr std::size_t kMostIdleTriangles = 8'000'000;

  // Returns the idle encoder whose memory fits `triangles` best, or a new one.
  std::unique_ptr<DracoEncoder> take(std::size_t triangles);
  void give_back(std::unique_ptr<DracoEncoder> encoder);

 private:
  Mutex mutex_;
  std::vector<std::unique_ptr<DracoEncoder>> idle_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t idle_triangles_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::codec
