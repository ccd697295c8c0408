// Draco encoders with their memory, for whoever encodes next; private to this folder.
#pragma once

#include <memory>
#include <vector>

#include "base/mutex.h"
#include "server/codec/draco_chunk.h"

namespace isomesh::codec {

// Fresh memory costs a fifth of an encoding, so encoders outlive jobs, as the meshes of workers do.
// Thread safe.
class Encoders {
 public:
  // The process's. It keeps encoders that have together encoded at most kMostIdleTriangles at once,
  // which is some 250 MiB.
  static Encoders& instance();
  static constexpr std::size_t kMostIdleTriangles = 8'000'000;

  // The one whose memory fits so many triangles best; a new one if none is idle.
  std::unique_ptr<DracoEncoder> take(std::size_t triangles);
  void give_back(std::unique_ptr<DracoEncoder> encoder);

 private:
  Mutex mutex_;
  std::vector<std::unique_ptr<DracoEncoder>> idle_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t idle_triangles_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::codec
