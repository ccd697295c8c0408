#include "tests/unit/store/wall_clock.h"

#include <atomic>
#include <cstdint>

#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

namespace isomesh::test {
namespace {

std::atomic<std::int64_t> seconds_ahead = 0;

int read_clock(clockid_t clock, timespec* time) {
  const auto result = static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  if (clock == CLOCK_REALTIME) time->tv_sec += seconds_ahead;
  return result;
}

}  // namespace

ClockSetAhead::ClockSetAhead(std::chrono::seconds by) { seconds_ahead = by.count(); }
ClockSetAhead::~ClockSetAhead() { seconds_ahead = 0; }

}  // namespace isomesh::test

// In place of the C library's, for the C++ library too.
extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  return isomesh::test::read_clock(clock, time);
}
