// Folders for temporary files, and what remains of runs that were killed.
#include "client/cli/run_folder.h"

#include <csignal>
#include <cstdlib>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

class RunFolderTest : public testing::Test {
 protected:
  RunFolderTest() { ::setenv("TMPDIR", place_.path().c_str(), 1); }
  ~RunFolderTest() override { ::unsetenv("TMPDIR"); }

  std::size_t count() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(place_.path()), fs::directory_iterator()));
  }

  // A folder whose process was killed while it used it.
  static void leave_one() {
    const pid_t child = ::fork();
    if (child == 0) {
      const RunFolder folder;
      test::write_file(folder.path() / "data", "x");
      ::kill(::getpid(), SIGKILL);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
  }

  test::TemporaryFolder place_;
};

TEST_F(RunFolderTest, IsGoneAtItsEnd) {
  {
    const RunFolder folder;
    test::write_file(folder.path() / "data", "x");
    EXPECT_EQ(count(), 1U);
  }
  EXPECT_EQ(count(), 0U);
}

TEST_F(RunFolderTest, TheFolderOfAKilledRunIsRemovedByTheNext) {
  leave_one();
  leave_one();
  EXPECT_GE(count(), 1U);
  const RunFolder next;
  EXPECT_EQ(count(), 1U);
  EXPECT_TRUE(fs::exists(next.path()));
}

TEST_F(RunFolderTest, AFolderInUseStays) {
  const RunFolder first;
  test::write_file(first.path() / "data", "x");
  { const RunFolder second; }
  EXPECT_EQ(test::read_file(first.path() / "data"), "x");
}

TEST_F(RunFolderTest, NothingElseIsRemoved) {
  fs::create_directories(place_ / "isomesh-other" / "data");
  fs::create_directories(place_ / "elsewhere" / "data");
  fs::create_directory_symlink(place_ / "elsewhere", place_ / "isomesh-run-link");
  test::write_file(place_ / "isomesh-run-file", "x");
  { const RunFolder folder; }
  EXPECT_EQ(count(), 4U);
  EXPECT_TRUE(fs::exists(place_ / "elsewhere" / "data"));
}

TEST_F(RunFolderTest, AFolderWithoutALockIsForsaken) {
  fs::create_directories(place_ / "isomesh-run-123456" / "data");
  { const RunFolder folder; }
  EXPECT_EQ(count(), 0U);
}

// Each start removes what it takes for forsaken, while others have just made their folders.
TEST_F(RunFolderTest, NoStartRemovesTheFolderOfAnother) {
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([] {
      for (int round = 0; round < 200; ++round) {
        const RunFolder folder;
        test::write_file(folder.path() / "data", "x");
        ASSERT_EQ(test::read_file(folder.path() / "data"), "x");
      }
    });
  }
  threads.clear();
  EXPECT_EQ(count(), 0U);
}

}  // namespace
}  // namespace isomesh::cli
