#include "server/jobs/making/memory.h"

#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/support/files.h"

namespace isomesh::jobs {
namespace {

class UsableMemory : public testing::Test {
 protected:
  void write(const std::string& file, const std::string& text) {
    std::filesystem::create_directories((root_ / file).parent_path());
    test::write_file(root_ / file, text);
  }
  std::uint64_t usable() const { return usable_memory(root_.path()); }

  static std::uint64_t of_machine() {
    return static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
           static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  }

  const test::TemporaryFolder root_;
};

TEST_F(UsableMemory, IsTheMachinesWithoutAGroup) {
  EXPECT_EQ(usable(), of_machine());
  write("proc/self/cgroup", "0::/\n");
  EXPECT_EQ(usable(), of_machine());
  write("sys/fs/cgroup/memory.max", "max\n");
  EXPECT_EQ(usable(), of_machine());
  write("sys/fs/cgroup/memory.max", "18446744073709551615\n");
  EXPECT_EQ(usable(), of_machine());
}

TEST_F(UsableMemory, IsTheLeastOfItsGroupAndThoseAbove) {
  write("proc/self/cgroup", "0::/system.slice/isomesh.service\n");
  write("sys/fs/cgroup/system.slice/isomesh.service/memory.max", "419430400\n");
  EXPECT_EQ(usable(), 419430400U);
  write("sys/fs/cgroup/system.slice/memory.max", "209715200\n");
  EXPECT_EQ(usable(), 209715200U);
  write("sys/fs/cgroup/system.slice/memory.max", "max\n");
  EXPECT_EQ(usable(), 419430400U);
}

// A container sees its own group as the root, and may be told the name that it has outside.
TEST_F(UsableMemory, IsThatOfAContainer) {
  write("sys/fs/cgroup/memory.max", "1000000\n");
  write("proc/self/cgroup", "0::/\n");
  EXPECT_EQ(usable(), 1000000U);
  write("proc/self/cgroup", "0::/docker/0123456789abcdef\n");
  EXPECT_EQ(usable(), 1000000U);
}

TEST_F(UsableMemory, IsThatOfAGroupOfVersion1) {
  write("proc/self/cgroup", "5:cpu,cpuacct:/a\n4:memory:/a\n1:name=systemd:/a\n");
  write("sys/fs/cgroup/memory/a/memory.limit_in_bytes", "2000000\n");
  EXPECT_EQ(usable(), 2000000U);
}

TEST_F(UsableMemory, IsNotMisledByAFileOfAnotherForm) {
  write("proc/self/cgroup", "0\n\n:\n0::/a\n");
  write("sys/fs/cgroup/a/memory.max", "nonsense\n");
  EXPECT_EQ(usable(), of_machine());
}

}  // namespace
}  // namespace isomesh::jobs
