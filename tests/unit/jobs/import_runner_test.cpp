#include "server/jobs/library/import_runner.h"

#include <csignal>
#include <latch>
#include <limits>
#include <mutex>
#include <semaphore>
#include <set>
#include <stop_token>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/import/message/import_message.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::jobs {
namespace {

using std::chrono::seconds;
using test::TemporaryFolder;
using testing::HasSubstr;
using testing::Not;

// Runs the program that misbehaves as the upload says; what came of it is an error.
class Faulty {
 public:
  explicit Faulty(seconds longest = seconds(60), std::size_t at_once = 2)
      : runner_({.bounds = {.memory_bytes = std::uint64_t{128} << 20, .time = longest},
                 .at_once = at_once,
                 .program = FAULTY_IMPORT}) {}

  Error run(const std::string& what, const std::stop_token& cancelled = {}) {
    const TemporaryFolder folder;
    const TemporaryFolder scratch;
    test::write_file(folder / "upload", what);
    const ImportTask task = {
        .source = folder / "upload", .scratch = scratch.path(), .target = scratch / "canonical"};
    try {
      runner_.run(task, {}, cancelled);
    } catch (const Error& error) {
      return error;
    }
    return {ErrorCode::kInternal, "nothing was thrown"};
  }

  ImportRunner& runner() { return runner_; }

 private:
  ImportRunner runner_;
};

void expect_refused(const Error& error, const std::string& reason) {
  EXPECT_EQ(error.code(), ErrorCode::kUnusableVolume) << error.what();
  EXPECT_THAT(error.what(), HasSubstr(reason));
}

TEST(ImportRunner, ACrashIsOneRefusedUpload) {
  Faulty faulty;
  expect_refused(faulty.run("crash"),
                 "ended with signal 11 (segmentation fault) while reading nifti");
  expect_refused(faulty.run("exit"), "ended with status 7 while reading nifti");
  expect_refused(faulty.run(""), "ended with status 0 while reading nifti");
}

TEST(ImportRunner, AHangEndsWithItsTime) {
  const Error error = Faulty(seconds(10)).run("hang");
  expect_refused(error, "The import took too long: it ended after 10 seconds while reading nifti.");
  EXPECT_THAT(error.what(), HasSubstr("--import-seconds"));
  EXPECT_THAT(error.what(), Not(HasSubstr("malicious")));
  expect_refused(Faulty().run("close and hang"), "ended without a response while reading nifti");
}

TEST(ImportRunner, AnImportThatTookTooLongSaysSoAndWhatToDo) {
  const auto expect_slow = [](const Error& error, const std::string& limit,
                              const std::string& advice) {
    expect_refused(error, "The import took too long: it ended after " + limit);
    EXPECT_THAT(error.what(), HasSubstr(advice));
    EXPECT_THAT(error.what(), Not(HasSubstr("malicious")));
  };
  expect_slow(Faulty().run("run out of time"), "20 seconds of processor time while reading nifti",
              "send it uncompressed");
  expect_slow(Faulty(seconds(20)).run("run out of time"),
              "20 seconds of processor time while reading nifti", "--import-seconds");
  expect_refused(Faulty().run("crash"), "the file is damaged or malicious");
}

TEST(ImportRunner, ACrowdOfWordsIsCutOff) { expect_refused(Faulty().run("chatter"), "ended"); }

TEST(ImportRunner, WordsThatAreNoneOfOursAreAnInternalError) {
  for (const std::string what : {"babble", "forge"}) {
    const Error error = Faulty().run(what);
    EXPECT_EQ(error.code(), ErrorCode::kInternal) << what;
    EXPECT_THAT(error.what(), HasSubstr("malformed")) << what;
  }
}

TEST(ImportRunner, LabelsOutOfOrderAreNotBelieved) {
  EXPECT_EQ(Faulty().run("lie about labels").code(), ErrorCode::kInternal);
}

TEST(ImportRunner, AVolumeThatWasNotWrittenIsNotBelieved) {
  EXPECT_EQ(Faulty().run("lie").code(), ErrorCode::kInternal);
}

TEST(ImportRunner, AProgramThatIsNotThereIsAnInternalError) {
  ImportRunner runner({.bounds = {.time = seconds(1)}, .at_once = 1, .program = "/nonexistent"});
  const TemporaryFolder folder;
  test::write_file(folder / "upload", "x");
  const ImportTask task = {
      .source = folder / "upload", .scratch = folder.path(), .target = folder / "canonical"};
  EXPECT_THROW(runner.run(task), Error);
}

// A stopped process is killed before it begins, whether or not its order has reached it.
TEST(ImportRunner, AnImportIsNotLostWithAProcessThatDiesAsItIsTaken) {
  Faulty faulty(seconds(60), 1);
  ASSERT_TRUE(test::eventually([] { return test::children_of(::getpid()).size() == 2; }));
  const std::set<pid_t> prepared = test::children_of(::getpid());
  for (const pid_t child : prepared) ::kill(child, SIGSTOP);
  std::jthread killer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    for (const pid_t child : prepared) ::kill(child, SIGKILL);
  });
  EXPECT_STREQ(faulty.run("escape").what(), "[]");
}

TEST(ImportRunner, AConfinedProcessDoesNothingElse) {
  EXPECT_STREQ(Faulty().run("escape").what(), "[]");
}

// Under a sanitizer memory is not limited: see sandbox.cpp.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(ImportRunner, MemoryHasALimit) {
  expect_refused(Faulty().run("memory"), "ended with signal 6 (aborted) while reading nifti");
}
#endif

TEST(ImportRunner, StoppingEndsThoseThatRunAndThoseThatWait) {
  Faulty faulty(seconds(600), 1);
  std::atomic<int> ended = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 3; ++thread) {
    threads.emplace_back([&] {
      const Error error = faulty.run("hang");
      EXPECT_EQ(error.code(), ErrorCode::kUnavailable) << error.what();
      ++ended;
    });
  }
  // The program, the copy that runs, and the next one.
  ASSERT_TRUE(test::eventually([] { return test::children_of(::getpid()).size() == 3; }));
  EXPECT_EQ(ended, 0);
  faulty.runner().stop();
  threads.clear();
  EXPECT_EQ(faulty.run("crash").code(), ErrorCode::kUnavailable);
}

TEST(ImportRunner, CancellingEndsOneThatRunsOrWaitsAndNoOther) {
  Faulty faulty(seconds(600), 1);
  std::stop_source cancel_running;
  std::stop_source cancel_waiting;
  std::jthread running([&] {
    EXPECT_EQ(faulty.run("hang", cancel_running.get_token()).code(), ErrorCode::kCancelled);
  });
  ASSERT_TRUE(test::eventually([] { return test::children_of(::getpid()).size() == 3; }));
  std::jthread waiting([&] {
    EXPECT_EQ(faulty.run("hang", cancel_waiting.get_token()).code(), ErrorCode::kCancelled);
  });
  cancel_waiting.request_stop();
  waiting.join();
  std::jthread next([&] { EXPECT_EQ(faulty.run("lie").code(), ErrorCode::kInternal); });
  cancel_running.request_stop();
  running.join();
  next.join();
  EXPECT_EQ(faulty.run("hang", cancel_running.get_token()).code(), ErrorCode::kCancelled);
}

// A client alone uses all places. When another one comes, it gets the next place that becomes free,
// however many imports of the first wait.
TEST(ImportPlaces, ALaterClientWaitsForOneImport) {
  for (const std::size_t count : {1, 2, 3}) {
    ImportPlaces places(count);
    std::mutex mutex;
    std::vector<std::string> begun;
    const auto number_begun = [&] {
      const std::scoped_lock lock(mutex);
      return begun.size();
    };
    std::counting_semaphore<> may_end(0);
    std::vector<std::jthread> threads;
    // Before the threads are joined, also if an assertion fails.
    const struct LetAllEnd {
      std::counting_semaphore<>& may_end;
      ~LetAllEnd() { may_end.release(10); }
    } at_end{may_end};
    const auto start = [&](const std::string& party) {
      threads.emplace_back([&, party] {
        const ImportPlaces::Place place = places.take(party, {});
        {
          const std::scoped_lock lock(mutex);
          begun.push_back(party);
        }
        may_end.acquire();
      });
    };
    for (std::size_t n = 0; n < count + 3; ++n) start("many");
    ASSERT_TRUE(test::eventually([&] { return number_begun() == count && places.waiting() == 3; }));
    start("other");
    ASSERT_TRUE(test::eventually([&] { return places.waiting() == 4; }));
    may_end.release();
    ASSERT_TRUE(test::eventually([&] { return number_begun() == count + 1; }));
    const std::scoped_lock lock(mutex);
    EXPECT_EQ(begun.back(), "other") << count;
  }
}

// Those in front of the next one in line are cancelled, and have not left when the place comes
// free: the next one finds them still there, and only they can tell it that they are gone.
TEST(ImportPlaces, APlaceThatComesFreeForCancelledOnesGoesToTheNext) {
  constexpr std::size_t kCancelled = 20;
  for (int round = 0; round < 5; ++round) {
    ImportPlaces places(1);
    std::latch has_begun(1);
    std::binary_semaphore may_end(0);
    std::jthread holder([&] {
      const ImportPlaces::Place place = places.take("party", {});
      has_begun.count_down();
      may_end.acquire();
    });
    has_begun.wait();
    std::stop_source cancel;
    std::vector<std::jthread> cancelled;
    for (std::size_t n = 0; n < kCancelled; ++n) {
      cancelled.emplace_back([&] {
        EXPECT_EQ(test::code_thrown_by([&] { places.take("party", cancel.get_token()); }),
                  ErrorCode::kUnavailable);
      });
    }
    EXPECT_TRUE(test::eventually([&] { return places.waiting() == kCancelled; }));
    std::atomic<bool> has_place = false;
    std::jthread next([&](const std::stop_token& stop) {
      test::code_thrown_by([&] {
        const ImportPlaces::Place place = places.take("party", stop);
        has_place = true;
      });
    });
    EXPECT_TRUE(test::eventually([&] { return places.waiting() == kCancelled + 1; }));
    // Runs when the stop is requested and nobody is woken yet, as the last callback runs first.
    const std::stop_callback give_back(cancel.get_token(), [&] {
      may_end.release();
      holder.join();
    });
    cancel.request_stop();
    ASSERT_TRUE(test::eventually([&] { return has_place.load(); }, seconds(60))) << round;
  }
}

TEST(ImportRunner, RawDescriptionsAreCheckedBeforeAnythingStarts) {
  ImportRunner runner({.bounds = {}, .at_once = 1, .program = "/nonexistent"});
  RawDescription raw;
  raw.dims = {2, 2, 2};
  raw.geometry.spacing[0] = std::numeric_limits<double>::quiet_NaN();
  ImportTask task;
  task.options.raw = raw;
  EXPECT_EQ(test::code_thrown_by([&] { runner.run(task); }), ErrorCode::kInvalidParameter);
}

// A file of ten kilobytes that keeps a reader busy for minutes is made to.
TEST(ImportBounds, ASmallUploadGetsLittleTime) {
  const ImportBounds most;
  EXPECT_EQ(bounds_for(10'000, most).time, std::chrono::seconds(20));
  EXPECT_EQ(bounds_for(std::uint64_t{1} << 20, most).time, std::chrono::seconds(36));
  EXPECT_EQ(bounds_for(std::uint64_t{1} << 40, most).time, most.time);
  EXPECT_EQ(bounds_for(0, {.time = std::chrono::seconds(1)}).time, std::chrono::seconds(1));
  EXPECT_EQ(bounds_for(0, most).memory_bytes, most.memory_bytes);
}

}  // namespace
}  // namespace isomesh::jobs
