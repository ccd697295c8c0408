// Transactions of several threads that are committed together.
#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <functional>
#include <latch>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "proto/error.h"
#include "server/store/file.h"
#include "server/store/sqlite/sqlite.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/unit/store/power_cut.h"

namespace isomesh::store {
namespace {

constexpr int kThreads = 12;

std::set<int> numbers_in(Connection& connection) {
  std::set<int> numbers;
  const Reading reading(connection);
  Rows query = reading->query("SELECT n FROM numbers");
  while (query.next()) numbers.insert(static_cast<int>(query.integer(0)));
  return numbers;
}

void insert(Connection& connection, int number, Durability durability = Durability::kFull) {
  Transaction transaction(connection, durability);
  transaction->run("INSERT INTO numbers VALUES(?)", number);
  transaction.commit();
}

class GroupCommit : public testing::Test {
 protected:
  GroupCommit() {
    writer_.script(
        "CREATE TABLE numbers(n INTEGER PRIMARY KEY);"
        "CREATE TABLE parents(n INTEGER PRIMARY KEY);"
        "CREATE TABLE children(n INTEGER REFERENCES parents(n) DEFERRABLE INITIALLY DEFERRED);");
    sync_folder(folder_.path());
  }

  // Runs `work` in many threads, all of which come while a transaction is open.
  void together(const std::function<void(int thread)>& work) {
    std::vector<std::jthread> threads;
    const Transaction open(writer_);
    for (int thread = 0; thread < kThreads; ++thread)
      threads.emplace_back([work, thread] { work(thread); });
    EXPECT_TRUE(test::eventually([this] { return writer_.coming() == std::size_t{kThreads}; }));
    threads_ = std::move(threads);
  }
  void join() { threads_.clear(); }

  std::set<int> numbers() { return numbers_in(reader_); }

  const test::TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_ / "records";
  test::PowerCut power_{folder_.path()};
  Connection writer_{file_, Connection::Mode::kWrite};
  Connection reader_{file_, Connection::Mode::kRead};
  std::vector<std::jthread> threads_;
};

TEST_F(GroupCommit, ThoseThatComeTogetherShareASync) {
  const std::size_t before = power_.syncs();
  together([this](int thread) { insert(writer_, thread); });
  join();
  EXPECT_EQ(numbers().size(), std::size_t{kThreads});
  EXPECT_EQ(power_.syncs() - before, 1U);
}

TEST_F(GroupCommit, OneThatGivesUpLeavesTheOthers) {
  together([this](int thread) {
    if (thread % 3 == 0) return insert(writer_, thread);
    Transaction transaction(writer_);
    transaction->run("INSERT INTO numbers VALUES(?)", thread);
    if (thread % 3 == 1) return;
    // Not unique: an error of this part alone.
    EXPECT_TRUE(
        test::thrown_by([&] { transaction->run("INSERT INTO numbers VALUES(?)", thread); }));
  });
  join();
  EXPECT_EQ(numbers(), (std::set<int>{0, 3, 6, 9}));
}

TEST_F(GroupCommit, ACommitThatFailsFailsForAllOfIt) {
  std::atomic<int> failed = 0;
  std::atomic<int> told = 0;
  together([&](int thread) {
    const auto error = test::thrown_by([&] {
      Transaction transaction(writer_);
      transaction->run("INSERT INTO numbers VALUES(?)", thread);
      transaction->run("INSERT INTO children VALUES(7)");  // noticed by the commit
      transaction.at_end([&](bool is_committed) { told += is_committed ? 100 : 1; });
      transaction.commit();
    });
    if (error) ++failed;
  });
  join();
  EXPECT_EQ(failed, kThreads);
  EXPECT_EQ(told, kThreads);
  EXPECT_TRUE(numbers().empty());
  insert(writer_, 1);
  EXPECT_EQ(numbers(), std::set<int>{1});
}

// A full disk takes the whole transaction of SQLite back, also what others have done in it.
TEST_F(GroupCommit, WhatAFullDiskTakesBackIsAcknowledgedToNobody) {
  writer_.script("PRAGMA max_page_count=8");
  std::mutex mutex;
  std::set<int> done;
  std::atomic<int> full = 0;
  together([&](int thread) {
    const auto error = test::thrown_by([&] {
      Transaction transaction(writer_);
      transaction->run("INSERT INTO numbers VALUES(?)", thread);
      if (thread % 4 == 3) {
        transaction->run(
            "WITH RECURSIVE many(n) AS (SELECT 1000 UNION ALL SELECT n + 1 FROM many WHERE n < "
            "99999) INSERT INTO numbers SELECT n FROM many");
      }
      transaction.commit();
    });
    if (error) {
      EXPECT_EQ(error->code(), ErrorCode::kOutOfSpace) << error->what();
      ++full;
      return;
    }
    const std::lock_guard lock(mutex);
    done.insert(thread);
  });
  join();
  EXPECT_GE(full, kThreads / 4);
  EXPECT_EQ(numbers(), done);
}

// A thread for which there was no space empties it, and may come while a commit waits for others.
TEST_F(GroupCommit, TheLogIsEmptiedBetweenTwoParts) {
  std::latch has_begun(1);
  const std::jthread member([&] {
    Transaction transaction(writer_);
    transaction->run("INSERT INTO numbers VALUES(1)");
    has_begun.count_down();
    EXPECT_TRUE(test::eventually([this] { return writer_.coming() == 1; }));
    transaction.commit();
  });
  has_begun.wait();
  const Transaction open(writer_);
  writer_.empty_log();
  EXPECT_EQ(std::filesystem::file_size(folder_ / "records-wal"), 0U);
  EXPECT_EQ(numbers(), std::set<int>{1});
}

TEST_F(GroupCommit, NobodySeesAPartBeforeAllIsCommitted) {
  {
    Transaction open(writer_);
    open->run("INSERT INTO numbers VALUES(1)");
    EXPECT_TRUE(numbers().empty());
  }
  together([this](int thread) {
    insert(writer_, thread);
    EXPECT_TRUE(numbers().contains(thread));
  });
  join();
}

TEST_F(GroupCommit, WhatNeedsTheDiskDoesNotTrustACommitThatDoesNot) {
  for (int round = 0; round < 5; ++round) {
    together([&](int thread) {
      const bool is_full = thread % 2 == 0;
      insert(writer_, round * kThreads + thread,
             is_full ? Durability::kFull : Durability::kProcess);
    });
    join();
  }
  const test::TemporaryFolder left;
  power_.leave(left.path());
  Connection after(left / "records", Connection::Mode::kWrite);
  const std::set<int> there = numbers_in(after);
  for (int n = 0; n < 5 * kThreads; n += 2) EXPECT_TRUE(there.contains(n)) << n;
}

TEST_F(GroupCommit, WhatWasCommittedSurvivesAPowerCutAtAnyTime) {
  std::mutex mutex;
  std::set<int> done;
  std::stop_source stop;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 6; ++thread) {
    threads.emplace_back([&, thread] {
      for (int n = 0; !stop.stop_requested(); ++n) {
        insert(writer_, n * 6 + thread);
        const std::lock_guard lock(mutex);
        done.insert(n * 6 + thread);
      }
    });
  }
  for (int cut = 0; cut < 10; ++cut) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    std::set<int> expected;
    {
      const std::lock_guard lock(mutex);
      expected = done;
    }
    const test::TemporaryFolder left;
    power_.leave(left.path());
    Connection after(left / "records", Connection::Mode::kWrite);
    EXPECT_TRUE(std::ranges::includes(numbers_in(after), expected)) << cut;
  }
  stop.request_stop();
}

TEST_F(GroupCommit, WhatWasCommittedSurvivesAKill) {
  int ends[2] = {-1, -1};
  ASSERT_EQ(::pipe(ends), 0);
  const auto other = folder_ / "other";
  {
    Connection(other, Connection::Mode::kWrite)
        .script("CREATE TABLE numbers(n INTEGER PRIMARY KEY)");
  }
  const pid_t child = ::fork();
  if (child == 0) {
    Connection connection(other, Connection::Mode::kWrite);
    std::vector<std::jthread> threads;
    for (int thread = 0; thread < 6; ++thread) {
      threads.emplace_back([&, thread] {
        for (int n = thread;; n += 6) {
          insert(connection, n);
          if (::write(ends[1], &n, sizeof(n)) != sizeof(n)) ::_exit(1);
        }
      });
    }
    for (;;) ::pause();
  }
  ::close(ends[1]);
  std::set<int> done;
  int n = 0;
  while (::read(ends[0], &n, sizeof(n)) == sizeof(n)) {
    done.insert(n);
    if (done.size() == 300) ::kill(child, SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ::close(ends[0]);
  Connection after(other, Connection::Mode::kWrite);
  EXPECT_GE(done.size(), 300U);
  EXPECT_TRUE(std::ranges::includes(numbers_in(after), done));
}

}  // namespace
}  // namespace isomesh::store
