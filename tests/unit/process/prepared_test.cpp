// Processes that are kept prepared: what a copy is, what becomes of those that die, and who ends
// them.
#include "server/process/prepared.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/niceness.h"
#include "proto/error.h"
#include "server/process/fork_server.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::process {
namespace {

using std::chrono::seconds;
using test::children_of;
using test::eventually;

// What a copy says of itself when it is asked.
std::string answer_of(const Child& child, const std::string& question = "?") {
  child.tell(question);
  return child.listen(4096, std::chrono::steady_clock::now() + seconds(60), {}).text;
}

TEST(PreparedProcesses, EachIsACopyThatWasNeverUsed) {
  PreparedProcesses prepared(COPIED_PROGRAM, 2);
  std::set<pid_t> seen;
  for (int run = 0; run < 5; ++run) {
    Child child = prepared.take();
    EXPECT_TRUE(seen.insert(child.pid()).second);
    // Begun anew: nothing of an earlier question is known; and it has no descriptor but its own.
    EXPECT_EQ(answer_of(child), "questions 1, descriptors 4");
    const auto status = child.ended_within(seconds(60));
    ASSERT_TRUE(status);
    EXPECT_EQ(*status, 0);
  }
}

// Whoever asks for what is there already goes before those who bring something.
TEST(PreparedProcesses, AreNicerThanTheirParent) {
  PreparedProcesses prepared(COPIED_PROGRAM, 1);
  const int nicer = std::min(::getpriority(PRIO_PROCESS, 0) + kImportNiceness, 19);
  EXPECT_EQ(answer_of(prepared.take(), "niceness"), std::to_string(nicer));
}

TEST(PreparedProcesses, AreNeverMoreThanWereAskedForAndTheirProgram) {
  PreparedProcesses prepared(COPIED_PROGRAM, 3);
  ASSERT_TRUE(eventually([] { return children_of(::getpid()).size() == 4; }));
  const Child taken = prepared.take();
  ASSERT_TRUE(eventually([] { return children_of(::getpid()).size() == 5; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(children_of(::getpid()).size(), 5U);
}

TEST(PreparedProcesses, OnesThatDieAreReplaced) {
  PreparedProcesses prepared(COPIED_PROGRAM, 2);
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(eventually([] { return children_of(::getpid()).size() == 3; }));
    for (const pid_t child : children_of(::getpid())) ::kill(child, SIGKILL);
    ASSERT_TRUE(eventually([] { return children_of(::getpid()).empty(); }));
    EXPECT_EQ(answer_of(prepared.take()), "questions 1, descriptors 4");
  }
}

TEST(PreparedProcesses, AreOfANewProgramAfterRenewal) {
  PreparedProcesses prepared(COPIED_PROGRAM, 1);
  const std::string first = answer_of(prepared.take(), "which");
  EXPECT_EQ(answer_of(prepared.take(), "which"), first);
  prepared.renew();
  EXPECT_NE(answer_of(prepared.take(), "which"), first);
}

TEST(PreparedProcesses, AProgramThatIsNotThereIsAnErrorEachTime) {
  PreparedProcesses prepared("/nonexistent", 1);
  for (int run = 0; run < 2; ++run) EXPECT_THROW(prepared.take(), Error);
}

TEST(PreparedProcesses, AProgramThatEndsAtOnceIsAnError) {
  PreparedProcesses prepared("/bin/true", 1);
  EXPECT_THROW(prepared.take(), Error);
}

TEST(PreparedProcesses, NoneIsGivenOnceStopped) {
  PreparedProcesses prepared(COPIED_PROGRAM, 1);
  prepared.stop();
  try {
    prepared.take();
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
  }
  EXPECT_TRUE(eventually([] { return children_of(::getpid()).empty(); }));
}

TEST(PreparedProcesses, GoWithTheirOwner) {
  {
    PreparedProcesses prepared(COPIED_PROGRAM, 2);
    ASSERT_TRUE(eventually([] { return children_of(::getpid()).size() == 3; }));
  }
  EXPECT_TRUE(children_of(::getpid()).empty());
}

// Killed, so that nothing but the kernel ends them. The one that was taken neither reads nor ends.
TEST(PreparedProcesses, DieWithTheirParent) {
  const test::TemporaryFolder folder;
  const pid_t parent = ::fork();
  if (parent == 0) {
    PreparedProcesses prepared(COPIED_PROGRAM, 2);
    const Child taken = prepared.take();
    taken.tell("hang");
    for (;;) ::pause();
  }
  ASSERT_TRUE(eventually([&] { return children_of(parent).size() == 4; }));
  const std::set<pid_t> children = children_of(parent);
  ::kill(parent, SIGKILL);
  int status = 0;
  ASSERT_EQ(::waitpid(parent, &status, 0), parent);
  EXPECT_TRUE(eventually([&] {
    return std::ranges::none_of(children, [](pid_t child) {
      std::ifstream file("/proc/" + std::to_string(child) + "/stat");
      std::string line;
      std::getline(file, line);
      return !line.empty() && line.find(") Z") == std::string::npos;
    });
  }));
}

}  // namespace
}  // namespace isomesh::process
