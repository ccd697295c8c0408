#include "server/volume/import_runner.h"

#include <limits>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/volume/import_message.h"
#include "tests/unit/volume/files.h"

namespace isomesh::volume::test {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;

class Clock {
 public:
  double elapsed() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Runs the program that misbehaves as the upload says; what came of it is an error.
class Faulty {
 public:
  explicit Faulty(seconds longest = seconds(60), std::size_t at_once = 2)
      : runner_({.bounds = {.memory_bytes = std::uint64_t{128} << 20, .time = longest},
                 .at_once = at_once,
                 .program = FAULTY_IMPORT}) {}

  Error run(const std::string& what) {
    const Folder folder;
    const Folder scratch;
    const ImportTask task = {.source = folder.write("upload", what),
                             .scratch = scratch.path("canonical").parent_path(),
                             .target = scratch.path("canonical")};
    try {
      runner_.run(task);
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
  expect_refused(faulty.run("crash"), "ended by signal 11 while reading nifti");
  expect_refused(faulty.run("exit"), "ended with status 7 while reading nifti");
  expect_refused(faulty.run(""), "ended with status 0 while reading nifti");
}

TEST(ImportRunner, AHangEndsWithItsTime) {
  Faulty faulty(seconds(1));
  const Clock clock;
  expect_refused(faulty.run("hang"), "after 1 seconds while reading nifti");
  expect_refused(faulty.run("close and hang"), "ended without an answer while reading nifti");
  EXPECT_LT(clock.elapsed(), 20);
}

TEST(ImportRunner, ACrowdOfWordsIsCutOff) { expect_refused(Faulty().run("chatter"), "ended"); }

TEST(ImportRunner, WordsThatAreNoneOfOursAreAnInternalError) {
  for (const std::string what : {"babble", "forge"}) {
    const Error error = Faulty().run(what);
    EXPECT_EQ(error.code(), ErrorCode::kInternal) << what;
    EXPECT_THAT(error.what(), HasSubstr("malformed")) << what;
  }
}

TEST(ImportRunner, AVolumeThatWasNotWrittenIsNotBelieved) {
  EXPECT_EQ(Faulty().run("lie").code(), ErrorCode::kInternal);
}

TEST(ImportRunner, AProgramThatIsNotThereIsAnInternalError) {
  ImportRunner runner({.bounds = {}, .at_once = 1, .program = "/nonexistent"});
  const Folder folder;
  const ImportTask task = {.source = folder.write("upload", "x"),
                           .scratch = folder.path(""),
                           .target = folder.path("canonical")};
  EXPECT_THROW(runner.run(task), Error);
}

TEST(ImportRunner, AConfinedProcessDoesNothingElse) {
  EXPECT_STREQ(Faulty().run("escape").what(), "[]");
}

TEST(ImportRunner, FilesHaveALimit) {
  EXPECT_STREQ(Faulty().run("file").what(), "it was not written");
}

// Under a sanitizer memory is not limited: see sandbox.cpp.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(ImportRunner, MemoryHasALimit) {
  expect_refused(Faulty().run("memory"), "ended by signal 6 while reading nifti");
}
#endif

TEST(ImportRunner, StoppingEndsThoseThatRunAndThoseThatWait) {
  Faulty faulty(seconds(600), 1);
  const Clock clock;
  std::atomic<int> ended = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 3; ++thread) {
    threads.emplace_back([&] {
      const Error error = faulty.run("hang");
      EXPECT_EQ(error.code(), ErrorCode::kUnavailable) << error.what();
      ++ended;
    });
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(ended, 0);
  faulty.runner().stop();
  threads.clear();
  EXPECT_LT(clock.elapsed(), 30);
  EXPECT_EQ(faulty.run("crash").code(), ErrorCode::kUnavailable);
}

TEST(ImportRunner, RawDescriptionsAreCheckedBeforeAnythingStarts) {
  ImportRunner runner({.bounds = {}, .at_once = 1, .program = "/nonexistent"});
  RawDescription raw;
  raw.dims = {2, 2, 2};
  raw.geometry.spacing[0] = std::numeric_limits<double>::quiet_NaN();
  ImportTask task;
  task.options.raw = raw;
  try {
    runner.run(task);
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  }
}

TEST(ImportMessage, AnOrderComesAsItWent) {
  ImportOrder order;
  order.task = {
      .source = "/a/\"b\"\n", .scratch = "/s", .target = "/s/t", .options = {}, .limits = {7}};
  order.task.options.series = "1.2.3";
  order.bounds = {.memory_bytes = 8, .time = seconds(9)};
  order.task.options.raw = RawDescription{.dims = {1, 2, 4294967295},
                                          .type = SampleType::kFloat64,
                                          .geometry = {.origin = {0.1, -1e300, 5e-324},
                                                       .spacing = {1.0 / 3, 2, 3},
                                                       .direction = {0, 1, 0, 1, 0, 0, 0, 0, -1}},
                                          .big_endian = true};
  const ImportOrder read = order_from(to_message(order));
  EXPECT_EQ(read.task.source, order.task.source);
  EXPECT_EQ(read.task.scratch, order.task.scratch);
  EXPECT_EQ(read.task.target, order.task.target);
  EXPECT_EQ(read.task.limits.max_sample_bytes, 7U);
  EXPECT_EQ(read.task.options.series, "1.2.3");
  EXPECT_EQ(read.bounds.memory_bytes, 8U);
  EXPECT_EQ(read.bounds.time, seconds(9));
  ASSERT_TRUE(read.task.options.raw);
  EXPECT_EQ(read.task.options.raw->dims, order.task.options.raw->dims);
  EXPECT_EQ(read.task.options.raw->type, SampleType::kFloat64);
  EXPECT_EQ(read.task.options.raw->geometry, order.task.options.raw->geometry);
  EXPECT_TRUE(read.task.options.raw->big_endian);
}

TEST(ImportMessage, AReportHasWhatWasSaid) {
  const Error refusal(ErrorCode::kUnusableVolume, "two \"series\"", {{"series", "1.2"}});
  const ImportReport report = report_from(reading_message("archive") + reading_message("dicom") +
                                          error_message(refusal) + "{\"read");
  EXPECT_EQ(report.reading, "dicom");
  EXPECT_FALSE(report.volume);
  ASSERT_TRUE(report.error);
  EXPECT_EQ(report.error->code(), ErrorCode::kUnusableVolume);
  EXPECT_STREQ(report.error->what(), "two \"series\"");
  EXPECT_EQ(report.error->fields(), refusal.fields());
}

}  // namespace
}  // namespace isomesh::volume::test
