// A system clock that is set while the test runs.
#pragma once

#include <chrono>

namespace isomesh::test {

// Sets this process's clock ahead, or back, for as long as it lives. The time that passes, as
// std::chrono::steady_clock counts it, goes on. One at a time.
class ClockSetAhead {
 public:
  explicit ClockSetAhead(std::chrono::seconds by);
  ~ClockSetAhead();
  ClockSetAhead(const ClockSetAhead&) = delete;
  ClockSetAhead& operator=(const ClockSetAhead&) = delete;
};

}  // namespace isomesh::test
