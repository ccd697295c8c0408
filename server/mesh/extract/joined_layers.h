// The joined crossings of a surface's layers, from when they are counted until they are written;
// private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/mutex.h"
#include "server/mesh/extract/clusters.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/spool.h"

namespace isomesh::mesh {

// Sets layers aside in a spool, and takes them back. Without a spool they stay where they are.
// Thread safe.
class JoinedLayers {
 public:
  // `layers` are the count's, and their place in memory. Both must outlive it.
  JoinedLayers(std::vector<ClusterLayer>& layers, Spool* spool) : layers_(layers), spool_(spool) {}

  // When there are as many layers as there will be.
  void prepare() { places_.resize(spool_ == nullptr ? 0 : layers_.size()); }
  // For one thread for each layer. The sums of the layer stay in memory.
  void put_aside(std::uint32_t z);
  void take_back(std::uint32_t begin, std::uint32_t end);
  void forget(std::uint32_t begin, std::uint32_t end);

 private:
  struct Place {
    std::uint64_t begin = 0;
    std::array<std::size_t, 5> sizes = {};  // of the layer's arrays
    bool is_aside = false;
  };

  std::vector<ClusterLayer>& layers_;
  Spool* const spool_;
  Mutex mutex_;  // while layers are taken back
  std::vector<Place> places_;
};

}  // namespace isomesh::mesh
