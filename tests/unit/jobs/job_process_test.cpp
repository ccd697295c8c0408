#include "server/jobs/queue/job_process.h"

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/niceness.h"
#include "tests/support/errors.h"
#include "tests/support/process.h"
#include "tests/unit/jobs/faulty_job.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using testing::HasSubstr;

class JobProcessTest : public test::JobsFixture {
 protected:
  JobOrder order_of(const Volume& volume, double iso, int passes = 5) const {
    JobOrder order = {.file = blobs_.path_of(volume.samples),
                      .volume = volume,
                      .parameters = {},
                      .iso = iso,
                      .memory_bytes = std::uint64_t{1} << 30,
                      .disk_bytes = std::uint64_t{1} << 30};
    order.parameters.passes = passes;
    return order;
  }

  // Runs the order in the process; the bytes of its files go to bytes_.
  MadeMesh make(JobProcess& process, const JobOrder& order, const Report& report = kQuiet,
                const std::stop_token& stop = {}) {
    bytes_.assign(order.parameters.formats.size(), "");
    std::vector<codec::Sink> sinks;
    for (std::string& bytes : bytes_) {
      sinks.emplace_back([&bytes](std::span<const std::byte> piece) {
        bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
      });
    }
    return process.make(order, sinks, stop, report);
  }

  std::optional<Error> refusal(JobProcess& process, const JobOrder& order,
                               const Report& report = kQuiet) {
    return test::thrown_by([&] { make(process, order, report); });
  }

  // The processes of jobs; the fixture has some for imports, too.
  std::set<pid_t> started() const {
    std::set<pid_t> found = test::children_of(::getpid());
    std::erase_if(found, [](pid_t child) { return test::program_of(child) != "isomesh-job"; });
    return found;
  }

  std::vector<std::string> bytes_;
  JobProcess process_{job_program()};
  JobProcess faulty_{job_program(FAULTY_JOB)};
};

// Requests go before meshes where the processors are busy.
TEST_F(JobProcessTest, ItsProcessIsNicerThanTheDaemon) {
  make(process_, order_of(add_sphere(), 0.5));
  for (const pid_t process : started()) {
    EXPECT_EQ(::getpriority(PRIO_PROCESS, static_cast<id_t>(process)),
              std::min(::getpriority(PRIO_PROCESS, 0) + kJobNiceness, 19));
  }
  EXPECT_EQ(started().size(), 1U);
}

TEST_F(JobProcessTest, MakesOneMeshAfterTheOtherInTheSameProcess) {
  const Volume sphere = add_sphere();
  std::set<Stage> stages;
  std::set<pid_t> processes;
  for (const double iso : {0.0, 0.5, 1.0}) {
    JobOrder order = order_of(sphere, iso);
    order.parameters.formats = {MeshFormat::kStl, MeshFormat::kDrc};
    const MadeMesh made =
        make(process_, order, [&](Stage stage, double, const Timing&) { stages.insert(stage); });
    EXPECT_GT(made.summary.triangles, 0U);
    EXPECT_GT(made.timing.encode, 0);
    EXPECT_EQ(bytes_[0].size(), 84 + 50 * made.summary.triangles);
    EXPECT_THAT(bytes_[1], testing::StartsWith("DRACO"));
    processes.merge(started());
    EXPECT_EQ(processes.size(), 1U);
  }
  EXPECT_EQ(stages, (std::set{Stage::kLoad, Stage::kExtract, Stage::kSmooth, Stage::kEncode}));
}

TEST_F(JobProcessTest, ProgressFollowsTheTimesThatTheOrderExpects) {
  JobOrder order = order_of(add_sphere(), 0.5);
  order.expected = {.load = 1, .extract = 2, .smooth = 3, .encode = 4};
  std::map<Stage, double> first;
  make(process_, order,
       [&](Stage stage, double share, const Timing&) { first.try_emplace(stage, share); });
  EXPECT_NEAR(first.at(Stage::kExtract), 0.1, 1e-9);
  EXPECT_NEAR(first.at(Stage::kSmooth), 0.3, 1e-9);
  EXPECT_NEAR(first.at(Stage::kEncode), 0.6, 1e-9);
}

// It may have a few dozen descriptors open, and gets one with each order.
TEST_F(JobProcessTest, AVolumeIsLetGoOfAfterItsJob) {
  JobOrder order = order_of(add_sphere(), 0.5);
  order.work = JobOrder::Work::kCount;
  std::set<pid_t> processes;
  for (int n = 0; n < 100; ++n) {
    EXPECT_GT(process_.count(order, {}).size.triangles, 0U);
    processes.merge(started());
  }
  EXPECT_EQ(processes.size(), 1U);
}

TEST_F(JobProcessTest, AVolumeThatIsNotThereIsAnError) {
  JobOrder order = order_of(add_sphere(), 0.5);
  std::filesystem::remove(order.file);
  EXPECT_EQ(refusal(process_, order)->code(), ErrorCode::kNotFound);
}

TEST_F(JobProcessTest, CountsTheSurfaceThatItWouldMake) {
  const Volume sphere = add_sphere();
  JobOrder order = order_of(sphere, 0);
  const MadeMesh made = make(process_, order);
  order.work = JobOrder::Work::kCount;
  const mesh::SurfaceSize size = process_.count(order, {}).size;
  EXPECT_EQ(size.triangles, made.summary.triangles);
  EXPECT_EQ(size.vertices, made.summary.vertices);
  EXPECT_GT(size.layers, 0U);
  EXPECT_GT(size.largest_layer(), 0U);
}

TEST_F(JobProcessTest, AJobThatIsStoppedEndsAndTheNextOneRunsInTheSameProcess) {
  const Volume much = add_much();
  std::stop_source stop;
  const Error error = test::error_of([&] {
    make(
        process_, order_of(much, 50, 1000),
        [&](Stage stage, double, const Timing&) {
          if (stage == Stage::kSmooth) stop.request_stop();
        },
        stop.get_token());
  });
  EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  EXPECT_GT(make(process_, order_of(add_sphere(), 0)).summary.triangles, 0U);
}

// A job that cannot be interrupted ends with its process.
TEST_F(JobProcessTest, AJobThatDoesNotStopIsKilled) {
  const Volume sphere = add_sphere();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(test::code_thrown_by(
                [&] { make(faulty_, order_of(sphere, test::kIsDeaf), kQuiet, stop.get_token()); }),
            ErrorCode::kCancelled);
  EXPECT_NO_THROW(make(faulty_, order_of(sphere, test::kAnswers)));
}

TEST_F(JobProcessTest, ADiskThatIsFullStopsTheJobAndIsTold) {
  const Volume much = add_much();
  const codec::Sink full = [](std::span<const std::byte>) {
    throw Error(ErrorCode::kOutOfSpace, "the disk is full");
  };
  JobOrder order = order_of(much, 50, 0);
  order.parameters.formats = {MeshFormat::kStl};
  EXPECT_EQ(test::code_thrown_by([&] { process_.make(order, {{full}}, {}, kQuiet); }),
            ErrorCode::kOutOfSpace);
  EXPECT_GT(make(process_, order_of(add_sphere(), 0)).summary.triangles, 0U);
}

class KilledIn : public JobProcessTest, public testing::WithParamInterface<Stage> {};

TEST_P(KilledIn, TheJobIsToldHowAndTheNextOneRuns) {
  const Volume much = add_much();
  const int passes = GetParam() == Stage::kEncode ? 0 : 1000;
  const auto error =
      refusal(process_, order_of(much, 50, passes), [&](Stage stage, double, const Timing&) {
        if (stage != GetParam()) return;
        for (const pid_t child : started()) ::kill(child, SIGKILL);
      });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kInternal);
  EXPECT_THAT(error->what(), HasSubstr("ended with signal 9 (killed) in the stage"));
  EXPECT_GT(make(process_, order_of(add_sphere(), 0)).summary.triangles, 0U);
}

INSTANTIATE_TEST_SUITE_P(Stages, KilledIn,
                         testing::Values(Stage::kLoad, Stage::kExtract, Stage::kSmooth,
                                         Stage::kEncode),
                         [](const auto& stage) { return std::string(to_string(stage.param)); });

TEST_F(JobProcessTest, AnIdleProcessThatDiedCostsNoJob) {
  const Volume sphere = add_sphere();
  make(process_, order_of(sphere, 0));
  for (const pid_t child : started()) ::kill(child, SIGKILL);
  ASSERT_TRUE(test::eventually([&] { return started().empty(); }));
  EXPECT_GT(make(process_, order_of(sphere, 0.5)).summary.triangles, 0U);
}

TEST_F(JobProcessTest, SaysHowAProcessEnded) {
  const Volume sphere = add_sphere();
  const auto error = refusal(faulty_, order_of(sphere, test::kExits));
  ASSERT_TRUE(error);
  EXPECT_STREQ(error->what(), "The job process ended with status 3 in the stage \"encode\".");
  EXPECT_THAT(refusal(faulty_, order_of(sphere, test::kDiesInAFile))->what(),
              HasSubstr("with signal 9 (killed)"));
  EXPECT_STREQ(refusal(faulty_, order_of(sphere, test::kRunsOutOfTime))->what(),
               "The job process ended because it took too much processor time in the stage "
               "\"encode\".");
}

TEST_F(JobProcessTest, BelievesNothingThatIsNotAsAgreed) {
  const Volume sphere = add_sphere();
  for (const double fault : {test::kTalksNonsense, test::kMakesAnotherFile, test::kTalksForEver,
                             test::kAnswersAnotherOrder, test::kNeverBegins}) {
    const auto error = refusal(faulty_, order_of(sphere, fault));
    ASSERT_TRUE(error) << fault;
    EXPECT_EQ(error->code(), ErrorCode::kInternal) << fault;
    EXPECT_NO_THROW(make(faulty_, order_of(sphere, test::kAnswers))) << fault;
  }
}

TEST(JobMessage, ArrivesAsItWasSent) {
  JobOrder order = {.work = JobOrder::Work::kCount,
                    .file = {},
                    .volume = {},
                    .parameters = {},
                    .iso = 0.1,
                    .memory_bytes = std::uint64_t{1} << 60,
                    .disk_bytes = ~std::uint64_t{0}};
  order.volume.samples = "samples";
  order.volume.notes = {{"code", "one\nand\tanother"}, {"other", ""}};
  order.parameters.passes = 17;
  order.parameters.lambda = 0.7;
  order.parameters.formats = {MeshFormat::kStl, MeshFormat::kGlb};
  const std::string line = to_line(order);
  EXPECT_EQ(line.find('\n'), line.size() - 1);
  const auto read = order_from(line.substr(0, line.size() - 1));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->work, order.work);
  EXPECT_EQ(read->volume.samples, order.volume.samples);
  EXPECT_EQ(read->volume.notes, order.volume.notes);
  EXPECT_EQ(read->parameters, order.parameters);
  EXPECT_EQ(read->iso, order.iso);
  EXPECT_EQ(read->memory_bytes, order.memory_bytes);
  EXPECT_EQ(read->disk_bytes, order.disk_bytes);

  MadeMesh made;
  made.summary.triangles = 12;
  made.summary.quality.closed = true;
  made.timing.smooth = 1.5;
  const auto made_again = std::get<MadeMesh>(answer_from(to_line(made)));
  EXPECT_EQ(made_again.summary, made.summary);
  EXPECT_EQ(made_again.timing.smooth, 1.5);
  const auto error =
      std::get<Error>(answer_from(to_line(Error(ErrorCode::kTooLarge, "too\tlarge"))));
  EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
  EXPECT_STREQ(error.what(), "too\tlarge");
}

TEST(JobMessage, ACountComesAsItWent) {
  CountedSurface counted = {
      .size = {.triangles = 1, .vertices = 2, .layers = 3, .largest_runs = {1, 2}},
      .labels = {{.label = -5, .triangles = 6}},
      .searching_bytes = 7};
  const auto again = std::get<CountedSurface>(answer_from(to_line(counted)));
  EXPECT_EQ(again.size.triangles, 1U);
  EXPECT_EQ(again.size.vertices, 2U);
  EXPECT_EQ(again.size.layers, 3U);
  EXPECT_EQ(again.size.largest_runs, counted.size.largest_runs);
  EXPECT_EQ(again.labels, counted.labels);
  EXPECT_EQ(again.searching_bytes, 7U);
  const JobProgress progress = {
      .stage = Stage::kSmooth, .share = 0.25, .timing = {.load = 1, .extract = 2}};
  const auto told = std::get<JobProgress>(answer_from(to_line(progress)));
  EXPECT_EQ(told.stage, progress.stage);
  EXPECT_EQ(told.share, progress.share);
  EXPECT_EQ(told.timing, progress.timing);
}

TEST(JobMessage, AnotherFormIsRefused) {
  EXPECT_FALSE(order_from(kCancelMessage));
  for (const char* line :
       {"", "{}", "[]", "7", R"({"progress":{"stage":"none","share":0,"timing":{}}})",
        R"({"progress":{"stage":"load","share":0}})", R"({"piece":{"file":-1,"bytes":0}})",
        R"({"piece":{"file":0,"bytes":0.5}})", R"({"piece":{"file":true,"bytes":0}})",
        R"({"piece":{"file":0,"bytes":18446744073709551616}})", R"({"piece":[0,0]})",
        R"({"made":{}})", R"({"made":null})", R"({"order":{"work":2}})",
        R"({"counted":{"labels":7}})"}) {
    EXPECT_EQ(test::code_thrown_by([&] { answer_from(line); }), ErrorCode::kInternal) << line;
    EXPECT_EQ(test::code_thrown_by([&] { order_from(line); }), ErrorCode::kInternal) << line;
  }
}

// Under the sanitizers memory is not limited.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

constexpr std::uint64_t kGibibyte = std::uint64_t{1} << 30;

// The limit of a process's memory and the most that it can raise that to, in bytes.
std::array<std::uint64_t, 2> memory_limits_of(pid_t process) {
  rlimit limits = {};
  EXPECT_EQ(::prlimit(process, RLIMIT_DATA, nullptr, &limits), 0);
  return {limits.rlim_cur, limits.rlim_max};
}

TEST_F(JobProcessTest, AJobHasTheMemoryOfItsOrder) {
  const Volume sphere = add_sphere();
  JobOrder order = order_of(sphere, 0);
  for (const std::uint64_t memory : {kGibibyte, kGibibyte / 4}) {
    order.memory_bytes = memory;
    make(process_, order);
    const auto [limit, most] = memory_limits_of(*started().begin());
    EXPECT_GE(limit, memory);
    EXPECT_LE(limit, memory + kGibibyte / 2);
  }
}

TEST_F(JobProcessTest, NoProcessCanHaveMoreThanTheMostOfAnOrder) {
  JobProgram program = job_program();
  program.setup.memory_bytes = kGibibyte;
  JobProcess process(program);
  make(process, order_of(add_sphere(), 0));
  const auto [limit, most] = memory_limits_of(*started().begin());
  EXPECT_GE(most, limit);
  EXPECT_LE(most, 2 * kGibibyte);
}

// The shell gives the process less than the order says.
TEST_F(JobProcessTest, AJobThatTakesMoreThanItMayIsToldSo) {
  const auto limited = folder_ / "limited";
  test::write_file(limited, "#!/bin/sh\nulimit -d 65536\nexec " ISOMESH_JOB "\n");
  std::filesystem::permissions(limited, std::filesystem::perms::owner_all);
  JobProcess process(job_program(limited));
  const auto error = refusal(process, order_of(add_much(), 50));
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kTooLarge);
  EXPECT_STREQ(error->what(), "the job needs more than the 1024 MiB of memory that it may use");
}

#endif

// As an upgrade of the package replaces it, while the daemon still runs.
TEST_F(JobProcessTest, AProgramThatIsHeldOutlivesItsFile) {
  const auto file = folder_ / "isomesh-job";
  std::filesystem::copy_file(ISOMESH_JOB, file);
  JobProgram program = job_program();
  program.file = process::hold_program(file);
  std::filesystem::remove(file);
  std::filesystem::copy_file("/bin/false", file);
  JobProcess process(program);
  make(process, order_of(add_sphere(), 0.5));
  EXPECT_FALSE(bytes_.at(0).empty());
  EXPECT_EQ(started().size(), 1U) << "it shows its name";
}

}  // namespace
}  // namespace isomesh::jobs
