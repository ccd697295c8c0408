#include "base/niceness.h"

#include <cstdint>
#include <tuple>

#include <sys/syscall.h>
#include <unistd.h>

namespace isomesh {
namespace {

// sched_attr from linux/sched/types.h, which conflicts with the C library's sched.h.
struct SchedulingAttributes {
  std::uint32_t size = 0;
  std::uint32_t policy = 0;
  std::uint64_t flags = 0;
  std::int32_t niceness = 0;
  std::uint32_t priority = 0;
  std::uint64_t slice_ns = 0;
  std::uint64_t deadline_ns = 0;
  std::uint64_t period_ns = 0;
};

// The kernel's minimum.
constexpr std::uint64_t kPromptSliceNs = 100'000;
constexpr std::uint64_t kUsualSliceNs = 0;

// Direct system calls: the C library has names for them only since glibc 2.41. All other attributes
// stay unchanged. An older kernel, or a sandbox that forbids the calls, keeps the usual slices.
void set_slice(std::uint64_t slice_ns) {
  SchedulingAttributes attributes;
  if (::syscall(SYS_sched_getattr, 0, &attributes, sizeof(attributes), 0) != 0) return;
  attributes.slice_ns = slice_ns;
  std::ignore = ::syscall(SYS_sched_setattr, 0, &attributes, 0);
}

}  // namespace

// On Linux it applies to this thread only. Raising the niceness needs no privilege, and the
// returned value is not an error code.
void be_nicer(int by) {
  if (by == 0) return;
  std::ignore = ::nice(by);
  set_slice(kUsualSliceNs);
}

void be_prompt() { set_slice(kPromptSliceNs); }

}  // namespace isomesh
