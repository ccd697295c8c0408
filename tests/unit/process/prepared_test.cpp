// Processes that are kept prepared: what a copy is, what becomes of those that die, and who ends
// them.
#include "server/process/prepared.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <random>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/niceness.h"
#include "proto/error.h"
#include "server/process/fork_server.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::process {
namespace {

using std::chrono::seconds;
using test::children_of;
using test::eventually;

// Until when to wait for what comes.
std::chrono::steady_clock::time_point soon() {
  return std::chrono::steady_clock::now() + test::kLongest;
}

// Until when to wait for what does not come.
std::chrono::steady_clock::time_point at_once() {
  return std::chrono::steady_clock::now() + std::chrono::milliseconds(20);
}

// Sends the question to a copy and returns its reply.
std::string answer_of(const Child& child, const std::string& question = "?") {
  child.send_last(question);
  return child.receive(4096, std::chrono::steady_clock::now() + seconds(60), {}).text;
}

Child told_to_hang(PreparedProcesses& prepared) {
  Child child = prepared.take(soon());
  child.send_last("hang");
  return child;
}

// Chooses the first processor that this process may use.
void stay_on_one_processor() {
  cpu_set_t all;
  ::sched_getaffinity(0, sizeof(all), &all);
  int first = 0;
  while (!CPU_ISSET(first, &all)) ++first;
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(first, &one);
  ::sched_setaffinity(0, sizeof(one), &one);
}

// Ctrl-C in a terminal reaches the daemon alone, which ends them.
TEST(PreparedProcesses, AreInAProcessGroupOfTheirOwn) {
  PreparedProcesses prepared(COPIED_PROGRAM, 1);
  const Child child = prepared.take(soon());
  EXPECT_NE(::getpgid(child.pid()), ::getpgrp());
  EXPECT_NE(::getpgid(child.pid()), -1);
}

TEST(PreparedProcesses, EachIsACopyThatWasNeverUsed) {
  PreparedProcesses prepared(COPIED_PROGRAM, 2);
  std::set<pid_t> seen;
  for (int run = 0; run < 5; ++run) {
    Child child = prepared.take(soon());
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
  EXPECT_EQ(answer_of(prepared.take(soon()), "niceness"), std::to_string(nicer));
}

TEST(PreparedProcesses, AreNeverMoreThanWereAskedForAndTheirProgram) {
  PreparedProcesses prepared(COPIED_PROGRAM, 3);
  ASSERT_TRUE(eventually([] { return children_of(::getpid()).size() == 4; }));
  std::vector<Child> taken;
  while (taken.size() < 20) {
    taken.push_back(prepared.take(soon()));
    EXPECT_LE(children_of(::getpid()).size(), 4 + taken.size());
  }
  EXPECT_TRUE(eventually([] { return children_of(::getpid()).size() == 24; }));
}

TEST(PreparedProcesses, OnesThatDieAreReplaced) {
  PreparedProcesses prepared(COPIED_PROGRAM, 2);
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(eventually([] { return children_of(::getpid()).size() == 3; }));
    ASSERT_TRUE(eventually([] {  // one may be replaced before the next is killed
      for (const pid_t child : children_of(::getpid())) ::kill(child, SIGKILL);
      return children_of(::getpid()).empty();
    }));
    EXPECT_EQ(answer_of(prepared.take(soon())), "questions 1, descriptors 4");
  }
}

TEST(PreparedProcesses, AreOfANewProgramAfterRenewal) {
  PreparedProcesses prepared(COPIED_PROGRAM, 1);
  const std::string first = answer_of(prepared.take(soon()), "which");
  EXPECT_EQ(answer_of(prepared.take(soon()), "which"), first);
  prepared.renew();
  EXPECT_NE(answer_of(prepared.take(soon()), "which"), first);
}

TEST(PreparedProcesses, OfAProgramThatIsHeldAreNeverOfAnotherOne) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder / "some-program";
  std::filesystem::copy_file(COPIED_PROGRAM, file);
  PreparedProcesses prepared(hold_program(file), 1);
  std::filesystem::remove(file);
  std::filesystem::copy_file("/bin/true", file);
  for (int renewals = 0; renewals < 2; ++renewals) {
    const Child child = prepared.take(soon());
    EXPECT_EQ(test::program_of(child.pid()), "some-program");
    EXPECT_EQ(answer_of(child), "questions 1, descriptors 4");
    prepared.renew();
  }
}

TEST(PreparedProcesses, AProgramThatIsNotThereIsAnErrorEachTime) {
  PreparedProcesses prepared("/nonexistent", 1);
  for (int run = 0; run < 2; ++run) EXPECT_THROW(prepared.take(at_once()), Error);
}

TEST(PreparedProcesses, AProgramThatEndsAtOnceIsAnError) {
  PreparedProcesses prepared("/bin/true", 1);
  EXPECT_THROW(prepared.take(at_once()), Error);
}

// As one may on a busy machine.
TEST(PreparedProcesses, AProgramThatEndsThreeTimesBeforeItAnswersIsStartedAFourthTime) {
  const test::TemporaryFolder folder;
  const std::filesystem::path program = folder / "program";
  const std::string starts = folder / "starts";
  test::write_file(program, "#!/bin/sh\necho >> " + starts + "\n[ $(wc -l < " + starts +
                                ") -gt 3 ] && exec " COPIED_PROGRAM "\nkill -9 $$\n");
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  PreparedProcesses prepared(program, 1);
  EXPECT_EQ(answer_of(prepared.take(soon())), "questions 1, descriptors 4");
  EXPECT_EQ(test::read_file(starts), "\n\n\n\n");
}

TEST(PreparedProcesses, NoneIsGivenOnceStopped) {
  PreparedProcesses prepared(COPIED_PROGRAM, 1);
  prepared.stop();
  EXPECT_EQ(test::code_thrown_by([&] { prepared.take(soon()); }), ErrorCode::kUnavailable);
  EXPECT_TRUE(eventually([] { return children_of(::getpid()).empty(); }));
}

TEST(PreparedProcesses, WaitingForOneCanBeCancelled) {
  PreparedProcesses prepared("/nonexistent", 1);
  std::stop_source stop;
  const std::jthread canceller([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // likely after the wait has begun
    stop.request_stop();
  });
  EXPECT_EQ(test::code_thrown_by([&] {
              prepared.take(std::chrono::steady_clock::now() + std::chrono::hours(1),
                            stop.get_token());
            }),
            ErrorCode::kCancelled);
}

TEST(PreparedProcesses, GoWithTheirOwner) {
  {
    PreparedProcesses prepared(COPIED_PROGRAM, 2);
    ASSERT_TRUE(eventually([] { return children_of(::getpid()).size() == 3; }));
  }
  // One that was just being made notices by itself.
  EXPECT_TRUE(eventually([] { return children_of(::getpid()).empty(); }));
}

// Killed, so that nothing but the kernel ends them. The one that was taken neither reads nor ends.
TEST(PreparedProcesses, DieWithTheirParent) {
  const test::TemporaryFolder folder;
  const pid_t parent = ::fork();
  if (parent == 0) {
    PreparedProcesses prepared(COPIED_PROGRAM, 2);
    const Child taken = prepared.take(soon());
    taken.send_last("hang");
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

// Whatever of them was just begun: what a killed parent leaves becomes this process's child. On one
// processor a copy often has its order, and no parent any more, before it runs for the first time.
TEST(PreparedProcesses, NoneOutlivesAParentThatIsKilledAtAnyMoment) {
  constexpr int kParents = 500;
  ASSERT_EQ(::prctl(PR_SET_CHILD_SUBREAPER, 1), 0);
  std::minstd_rand random;
  for (int n = 0; n < kParents; ++n) {
    const unsigned copies = random() % 4;
    const auto more = std::chrono::microseconds(random() % 400);
    const pid_t parent = ::fork();
    if (parent == 0) {
      stay_on_one_processor();
      PreparedProcesses prepared(COPIED_PROGRAM, 1);
      std::vector<Child> taken;
      while (taken.size() < copies) taken.push_back(told_to_hang(prepared));
      const auto end = std::chrono::steady_clock::now() + more;
      while (std::chrono::steady_clock::now() < end) taken.push_back(told_to_hang(prepared));
      ::kill(::getpid(), SIGKILL);
    }
    ASSERT_EQ(::waitpid(parent, nullptr, 0), parent);
  }
  const bool all_end = eventually([] {
    while (::waitpid(-1, nullptr, WNOHANG) > 0) {
    }
    return children_of(::getpid()).empty();
  });
  EXPECT_TRUE(all_end) << children_of(::getpid()).size() << " go on";
  for (const pid_t orphan : children_of(::getpid())) ::kill(orphan, SIGKILL);
  ::prctl(PR_SET_CHILD_SUBREAPER, 0);
}

}  // namespace
}  // namespace isomesh::process
