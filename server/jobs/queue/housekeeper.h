#pragma once

#include <chrono>
#include <thread>

#include "server/store/retention.h"

namespace isomesh::jobs {

// A thread that lets `retention` remove expired data. `retention` must outlive it.
class Housekeeper {
 public:
  // Runs at once and then every `interval`.
  Housekeeper(store::Retention& retention, std::chrono::milliseconds interval);

 private:
  std::jthread thread_;
};

}  // namespace isomesh::jobs
