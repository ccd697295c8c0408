#pragma once

#include <chrono>
#include <thread>

#include "server/store/retention.h"

namespace isomesh::jobs {

// The thread that has retention remove what is not to be kept any longer. `retention` must outlive
// it.
class Housekeeper {
 public:
  // Looks at once and every `interval` from then on.
  Housekeeper(store::Retention& retention, std::chrono::milliseconds interval);

 private:
  std::jthread thread_;
};

}  // namespace isomesh::jobs
