#include "base/niceness.h"

#include <array>
#include <cstdint>
#include <thread>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace isomesh {
namespace {

// The length of the calling thread's slices, in nanoseconds; 0 where the kernel does not say.
std::uint64_t slice() {
  // sched_attr, whose fourth word of eight bytes is the length.
  std::array<std::uint64_t, 6> attributes = {};
  EXPECT_EQ(::syscall(SYS_sched_getattr, 0, attributes.data(), sizeof(attributes), 0), 0);
  return attributes[3];
}

int niceness() { return ::getpriority(PRIO_PROCESS, 0); }

TEST(Niceness, APromptThreadAndThoseThatItStartsHaveShortSlices) {
  if (slice() == 0)
    GTEST_SKIP() << "this kernel gives no thread slices of its own (Linux 6.12 does)";
  std::thread([] {
    const std::uint64_t usual = slice();
    const int before = niceness();
    be_prompt();
    const std::uint64_t prompt = slice();
    EXPECT_LT(prompt, usual);
    EXPECT_EQ(niceness(), before);
    std::thread([&] { EXPECT_EQ(slice(), prompt); }).join();
    be_nicer(0);
    EXPECT_EQ(slice(), prompt);
  }).join();
}

TEST(Niceness, WhoIsNicerHasTheUsualSlices) {
  if (slice() == 0)
    GTEST_SKIP() << "this kernel gives no thread slices of its own (Linux 6.12 does)";
  std::thread([] {
    const std::uint64_t usual = slice();
    be_prompt();
    be_nicer(1);
    EXPECT_EQ(slice(), usual);
  }).join();
}

TEST(Niceness, OfAThreadIsOfNoOther) {
  const int mine = niceness();
  std::thread([mine] {
    be_nicer(1);
    EXPECT_EQ(niceness(), mine == 19 ? 19 : mine + 1);
  }).join();
  EXPECT_EQ(niceness(), mine);
}

}  // namespace
}  // namespace isomesh
