#pragma once

#include <chrono>
#include <thread>

#include "server/jobs/library/volume_library.h"
#include "server/store/retention.h"

namespace isomesh::jobs {

// A thread that lets `retention` remove expired data. Waits each time until `library` has erased
// the samples of deleted volumes: otherwise the sweep would take them for files of unknown origin.
// Both must outlive it.
class Housekeeper {
 public:
  // Runs at once and then every `interval`.
  Housekeeper(store::Retention& retention, VolumeLibrary& library,
              std::chrono::milliseconds interval);

 private:
  std::jthread thread_;
};

}  // namespace isomesh::jobs
