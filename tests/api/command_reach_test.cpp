// How the command names what is on the server, and how it ends.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/descriptor.h"
#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

class CommandReachTest : public testing::Test {
 protected:
  CommandReachTest() { write_file(folder_ / "sphere.raw", sphere_.bytes); }

  // `words` and the options that describe the sphere.
  std::vector<std::string> raw(const std::vector<std::string>& words) {
    return with(words, sphere_.options);
  }

  Daemon daemon_;
  TemporaryFolder folder_;
  const RawUpload sphere_ = sphere_upload();
};

TEST_F(CommandReachTest, IdsMayBeShortened) {
  const Job job = finished_job(daemon_);
  const std::string volume = job.parameters.volume;
  const std::string short_volume = volume.substr(0, 8);
  const std::string end_of_job = job.id.substr(job.id.size() - 6);
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"info", short_volume},
                                             {"labels", short_volume},
                                             {"estimate", short_volume, "--iso", "100"},
                                             {"submit", short_volume, "--iso", "100"},
                                             {"rename", short_volume, "ball"},
                                             {"status", job.id.substr(0, 20)},
                                             {"wait", end_of_job},
                                             {"fetch", end_of_job, "-o", folder_ / "out.drc"},
                                             {"cancel", job.id.substr(0, 20)}}) {
    const Finished result = daemon_.command(words);
    EXPECT_EQ(result.status, 0) << words[0] << ": " << result.errors;
  }
  EXPECT_THAT(daemon_.command({"list"}).output, HasSubstr("ball"));
  // It serves completion, so it tells nothing rather than late.
  const auto is_offered = [&](const std::string& kind, const std::string& id) {
    return eventually([&] {
      return daemon_.command({"ids", kind}).output.find(id + '\n') != std::string::npos;
    });
  };
  EXPECT_TRUE(is_offered("volumes", volume));
  EXPECT_TRUE(is_offered("jobs", job.id));

  const Finished none = daemon_.command({"info", "ffff0000ffff"});
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.errors, HasSubstr("there is no volume whose id begins or ends with"));
  // Ids of jobs begin with the time.
  const Job other = finished_job(daemon_);
  std::size_t same = 0;
  while (other.id[same] == job.id[same]) ++same;
  ASSERT_GE(same, 4U);
  const Finished several = daemon_.command({"cancel", job.id.substr(0, same)});
  EXPECT_EQ(several.status, 1);
  EXPECT_THAT(several.errors, HasSubstr("is ambiguous"));
  EXPECT_THAT(several.errors, HasSubstr(job.id));
  EXPECT_THAT(several.errors, HasSubstr(other.id));

  EXPECT_EQ(daemon_.command({"erase", short_volume}).status, 0);
  EXPECT_TRUE(daemon_.client().volumes().empty());
}

TEST_F(CommandReachTest, MeshTakesAStoredVolume) {
  const Volume volume = upload(daemon_, sphere_);
  const Finished result = daemon_.command(
      {"mesh", volume.id.substr(0, 10), "--iso", "100", "-o", folder_ / "stored.stl"});
  ASSERT_EQ(result.status, 0) << result.errors;
  ASSERT_EQ(daemon_
                .command(raw(
                    {"mesh", folder_ / "sphere.raw", "--iso", "100", "-o", folder_ / "sent.stl"}))
                .status,
            0);
  EXPECT_EQ(read_file(folder_ / "stored.stl"), read_file(folder_ / "sent.stl"));
  const Finished dry = daemon_.command({"mesh", volume.id, "--iso", "100", "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.errors;
  EXPECT_EQ(daemon_.client().volumes().size(), 1U) << "a dry run keeps what was stored before";
  const Finished absent =
      daemon_.command({"mesh", "ffff0000ffff", "--iso", "100", "-o", folder_ / "absent.stl"});
  EXPECT_EQ(absent.status, 1);
  EXPECT_THAT(absent.errors, HasSubstr("no volume whose id"));
}

// Three flat slabs, which the server takes for labels.
TEST_F(CommandReachTest, NotesNameTheirInputAndTheOption) {
  constexpr std::size_t kSlab = 32 * 32 * 10;
  for (const char* name : {"a.raw", "b.raw"}) {
    std::string bytes(32 * 32 * 32, '\0');
    bytes.replace(kSlab, kSlab, kSlab, '\3');
    bytes.replace(2 * kSlab, kSlab, kSlab, name[0]);
    write_file(folder_ / name, bytes);
  }
  const Finished both =
      daemon_.command({"mesh", folder_ / "a.raw", folder_ / "b.raw", "-o", folder_ / "{name}.stl",
                       "--dims", "32,32,32", "--type", "uint8", "--iso", "2"});
  EXPECT_EQ(both.status, 0) << both.errors;
  EXPECT_THAT(both.errors, HasSubstr("isomesh: a: note: "));
  EXPECT_THAT(both.errors, HasSubstr("isomesh: b: note: "));
  EXPECT_THAT(both.errors, HasSubstr("--labels all"));
  EXPECT_THAT(both.errors, Not(HasSubstr("\"labels\": ")));
}

TEST_F(CommandReachTest, AnIsoValueBeyondTheSamplesIsExplained) {
  const Finished result = daemon_.command(
      raw({"mesh", folder_ / "sphere.raw", "--iso", "9999", "-o", folder_ / "out.stl"}));
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("isomesh: "));
  EXPECT_THAT(result.errors,
              HasSubstr("no surface at the iso-value 9999; its samples range from 0 to "));
  const std::string job = daemon_.client().jobs().jobs.at(0).id;
  EXPECT_THAT(daemon_.command({"wait", job}).errors, HasSubstr("its samples range from 0 to "));
}

// A shell ends its loop if the command has died by SIGINT, and goes on if it has exited.
TEST(CommandInterrupted, EndsTheShellsLoop) {
  const Daemon daemon;
  const TemporaryFolder folder;
  write_file(folder / "noise.raw", rough_upload().bytes);
  const std::string mesh =
      std::string(ISOMESH) + " --server " + daemon.url() + " mesh " +
      (folder / "noise.raw").string() +
      " --dims 48,48,48 --type uint8 --iso 50 --smoothing optimize --passes 1000 -o " +
      (folder / "out.drc").string();
  // env: a test that runs in the background has inherited that SIGINT is ignored.
  Process shell({"env", "--default-signal=INT", "bash", "-c",
                 "for round in 1 2; do " + mesh + "; echo round $round; done; echo end"});
  const auto is_running = [&] {
    const auto jobs = daemon.client().jobs(JobState::kRunning).jobs;
    return jobs.size() == 1 && jobs.front().stage == Stage::kSmooth;
  };
  ASSERT_TRUE(eventually(is_running));
  const std::set<pid_t> children = children_of(shell.pid());
  ASSERT_EQ(children.size(), 1U);
  // As a terminal does, to all of the foreground.
  shell.send_signal(SIGINT);
  ::kill(*children.begin(), SIGINT);
  EXPECT_EQ(shell.wait(), 128 + SIGINT);
  EXPECT_EQ(shell.output(), "");
  EXPECT_THAT(shell.errors(), HasSubstr("was cancelled"));
  EXPECT_EQ(daemon.client().jobs().jobs.size(), 1U);
}

// Standard input is a pipe that the test holds open.
class CommandReadsTest : public testing::Test {
 protected:
  CommandReadsTest() {
    std::filesystem::create_directory(folder_ / "tmp");
    const std::string pipe = folder_ / "pipe";
    EXPECT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    pipe_ = Descriptor(::open(pipe.c_str(), O_RDWR | O_CLOEXEC));
  }

  // `environment` is an option of env(1). Returns when the first half of the sphere was copied.
  void begin(const std::string& environment) {
    std::string words = "exec " ISOMESH " --server " + daemon_.url() + " mesh - --iso 100 -o " +
                        (folder_ / "out.stl").string();
    for (const std::string& option : sphere_.options) words += ' ' + option;
    words += " < " + (folder_ / "pipe").string();
    command_.emplace(std::vector<std::string>{"env", environment, "bash", "-c", words},
                     std::vector<std::string>{"TMPDIR=" + (folder_ / "tmp").string()});
    send(std::string_view(sphere_.bytes).substr(0, half_));
    ASSERT_TRUE(eventually([&] {
      return std::ranges::any_of(files_below(folder_ / "tmp"), [&](const std::string& name) {
        return name.ends_with(".volume") && read_file(folder_ / "tmp" / name).size() == half_;
      });
    }));
  }

  void send(std::string_view bytes) const { write_all(pipe_, std::as_bytes(std::span(bytes))); }

  const Daemon daemon_;
  const TemporaryFolder folder_;
  const RawUpload sphere_ = sphere_upload();
  const std::size_t half_ = sphere_.bytes.size() / 2;
  Descriptor pipe_;
  std::optional<Process> command_;
};

TEST_F(CommandReadsTest, StandardInputUntilItIsStoppedAndLeavesNoCopy) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    begin("--default-signal=INT,TERM,HUP");
    command_->send_signal(signal);
    EXPECT_EQ(command_->wait(), 128 + signal);
    EXPECT_EQ(command_->errors(), "isomesh: interrupted\n");
    EXPECT_THAT(files_below(folder_ / "tmp"), testing::IsEmpty());
  }
}

// As nohup does it.
TEST_F(CommandReadsTest, StandardInputToItsEndIfItIsToOutliveItsTerminal) {
  begin("--ignore-signal=HUP");
  command_->send_signal(SIGHUP);
  send(std::string_view(sphere_.bytes).substr(half_));
  pipe_ = Descriptor();
  EXPECT_EQ(command_->wait(), 0) << command_->errors();
  EXPECT_GT(std::filesystem::file_size(folder_ / "out.stl"), 1000U);
}

}  // namespace
}  // namespace isomesh
