#include "base/niceness.h"

#include <cstdint>
#include <tuple>

#include <sys/syscall.h>
#include <unistd.h>

namespace isomesh {
namespace {

// As sched_attr in linux/sched/types.h, which cannot be included beside the C library's sched.h.
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

// The least that the kernel gives.
constexpr std::uint64_t kPromptSlice_ns = 100'000;
constexpr std::uint64_t kUsualSlice_ns = 0;

// The C library has names for these calls since glibc 2.41. All else stays as it is. A kernel that
// does not know slices, or a sandbox that allows neither call, leaves the usual ones.
void set_slice(std::uint64_t slice_ns) {
  SchedulingAttributes attributes;
  if (::syscall(SYS_sched_getattr, 0, &attributes, sizeof(attributes), 0) != 0) return;
  attributes.slice_ns = slice_ns;
  std::ignore = ::syscall(SYS_sched_setattr, 0, &attributes, 0);
}

}  // namespace

// On Linux of this thread alone. It is refused to nobody, and what it returns is no error.
void be_nicer(int by) {
  if (by == 0) return;
  std::ignore = ::nice(by);
  set_slice(kUsualSlice_ns);
}

void be_prompt() { set_slice(kPromptSlice_ns); }

}  // namespace isomesh
